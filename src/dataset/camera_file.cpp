// SPDX-License-Identifier: MIT
#include "dataset/camera_file.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include "config/config_yaml.hpp"
#include "dataset/frame_files.hpp"
#include "text/text_file.hpp"

namespace stemvo::dataset {
namespace {

using options::Field;
using options::Rule;

class Reader {
 public:
  explicit Reader(const std::filesystem::path& file) : file_(file) {}

  Expected<CameraFile> read() {
    CameraFile result;
    Status status = read_values();
    status = status ? set_size(result.lens.camera) : status;
    status = status ? set_intrinsics(result.lens.camera) : status;
    status = status ? set_distortion(result.lens) : status;
    if (!status) {
      return status.error();
    }
    const auto if_given = [](double value) {
      return value > 0.0 ? std::optional(value) : std::nullopt;
    };
    result.rate_hz = if_given(rate_hz_);
    result.camera_height_m = if_given(camera_height_m_);
    return result;
  }

 private:
  Status read_values() {
    Expected<std::string> text = read_text_file(file_);
    if (!text) {
      return text.error();
    }
    if (text->starts_with("%YAML:")) {
      text->front() = '#';  // OpenCV writes "%YAML:1.0", which is not YAML: read as a comment
    }
    Expected<YAML::Node> root = config::parse_document(*text, file_.string());
    if (!root) {
      return root.error();
    }
    root_ = *root;
    for (const char* key : {"sensor_type", "comment", "T_BS"}) {
      if (root_.IsMap()) {
        root_.remove(key);
      }
    }
    std::vector<Field> fields = this->fields();
    return config::read_document(root_, file_.string(), fields);
  }

  [[nodiscard]] Error missing(std::string_view expected) const {
    return fail(fmt::format("{}: expected {}, found no such key", file_.string(), expected));
  }
  /// "<file>:<line>: <key>: <problem>"
  [[nodiscard]] Error refuse(const std::string& key, const std::string& problem) const {
    return fail(fmt::format("{}: {}: {}",
                            at_line(file_, static_cast<std::size_t>(root_[key].Mark().line) + 1),
                            key, problem));
  }
  /// Whether a list has one of these lengths; `expected` names them.
  [[nodiscard]] Status check_length(const std::string& key,
                                    const std::vector<double>& numbers,
                                    const std::vector<std::size_t>& lengths,
                                    std::string_view expected) const {
    const bool may_be_absent = std::count(lengths.begin(), lengths.end(), 0U) != 0;
    if (!root_.IsMap() || !root_[key]) {
      return may_be_absent ? Status() : missing(fmt::format("{}: {}", key, expected));
    }
    if (std::count(lengths.begin(), lengths.end(), numbers.size()) == 0) {
      return refuse(key, fmt::format("expected {}, found {} numbers", expected, numbers.size()));
    }
    return {};
  }

  Status set_size(Camera& camera) const {
    camera.width_px = width_px_;
    camera.height_px = height_px_;
    if ((width_px_ == 0) != (height_px_ == 0)) {
      return fail(fmt::format("{}: expected image_width and image_height, found {} alone",
                              file_.string(), width_px_ == 0 ? "image_height" : "image_width"));
    }
    if (width_px_ > 0) {
      return {};
    }
    if (resolution_.empty()) {
      return missing("image_width and image_height, or resolution: [width, height]");
    }
    for (const double side : resolution_) {
      if (side != std::floor(side)) {
        return refuse("resolution", fmt::format("expected whole pixels, found {}", side));
      }
    }
    const Status status = check_length("resolution", resolution_, {2}, "[width, height]");
    if (status) {
      camera.width_px = static_cast<int>(resolution_[0]);
      camera.height_px = static_cast<int>(resolution_[1]);
    }
    return status;
  }

  Status set_intrinsics(Camera& camera) const {
    const std::vector<double>& numbers = intrinsics_;
    if (const Status status = check_length("intrinsics", numbers, {4}, "[fx, fy, cx, cy]");
        !status) {
      return status;
    }
    camera.fx_px = numbers[0];
    camera.fy_px = numbers[1];
    camera.cx_px = numbers[2];
    camera.cy_px = numbers[3];
    if (!(camera.fx_px >= 1e-3) || !(camera.fy_px >= 1e-3)) {
      return refuse("intrinsics", fmt::format("expected positive focal lengths, found {} and {}",
                                              camera.fx_px, camera.fy_px));
    }
    const Status status = check_center(camera);
    return status ? status : refuse("intrinsics", status.error().message);
  }

  Status set_distortion(Lens& lens) const {
    const std::string& model = distortion_model_;
    const std::vector<double>& numbers = distortion_coefficients_;
    if (model.empty()) {
      return missing("distortion_model: none, radial-tangential or equidistant");
    }
    constexpr const char* kKey = "distortion_coefficients";
    Status status;
    if (model == "none") {
      lens.distortion = Distortion::kNone;
      status = check_length(kKey, numbers, {0}, "[] for distortion_model none");
    } else if (model == "equidistant") {
      lens.distortion = Distortion::kEquidistant;
      status = check_length(kKey, numbers, {4}, "[k1, k2, k3, k4]");
    } else {
      lens.distortion = Distortion::kRadialTangential;
      status = check_length(kKey, numbers, {4, 5}, "[k1, k2, p1, p2] or [k1, k2, p1, p2, k3]");
    }
    if (status) {
      std::copy(numbers.begin(), numbers.end(), lens.coefficients.begin());
    }
    return status;
  }

  std::vector<Field> fields() {
    const Rule side = Rule::between(1.0, kMaxImageSide_px);
    const Rule distortion = Rule::one_of({"none", "radial-tangential", "radtan", "equidistant"});
    return {
        {"", "image_width", &width_px_, side, ""},
        {"", "image_height", &height_px_, side, ""},
        {"", "resolution", &resolution_, side, ""},
        {"", "camera_model", &camera_model_, Rule::one_of({"pinhole"}), ""},
        {"", "intrinsics", &intrinsics_, Rule::between(-1e6, 1e6), ""},
        {"", "distortion_model", &distortion_model_, distortion, ""},
        {"", "distortion_coefficients", &distortion_coefficients_, Rule::between(-1e4, 1e4), ""},
        {"", "rate_hz", &rate_hz_, Rule::between(1e-9, 1e5), ""},
        {"", "camera_height", &camera_height_m_, Rule::between(1e-9, 1000.0), ""}};
  }

  std::filesystem::path file_;
  YAML::Node root_;
  // What the keys say; as here where they are absent.
  int width_px_ = 0;
  int height_px_ = 0;
  std::vector<double> resolution_;
  std::string camera_model_;
  std::vector<double> intrinsics_;
  std::string distortion_model_;
  std::vector<double> distortion_coefficients_;
  double rate_hz_ = 0.0;
  double camera_height_m_ = 0.0;
};

}  // namespace

Expected<CameraFile> read_camera_file(const std::filesystem::path& file) {
  return Reader(file).read();
}

}  // namespace stemvo::dataset
