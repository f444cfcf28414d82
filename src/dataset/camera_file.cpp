// SPDX-License-Identifier: MIT
#include "dataset/camera_file.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include "config/config_yaml.hpp"
#include "dataset/camera_formats.hpp"
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
    status = status ? set_body(result.body_from_camera) : status;
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
    format_ = format_of_camera(*root);
    root_ = format_.keys;
    distortion_model_ = format_.implied_model;
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
    const char* key = format_.has_matrix ? "camera_matrix" : "intrinsics";
    const std::vector<double>& numbers = intrinsics_;
    Status status = format_.has_matrix
                        ? check_length(key, numbers, {9}, "data: [fx, 0, cx, 0, fy, cy, 0, 0, 1]")
                        : check_length(key, numbers, {4}, "[fx, fy, cx, cy]");
    if (!status) {
      return status;
    }
    const std::array<std::size_t, 4> places = format_.has_matrix
                                                  ? std::array<std::size_t, 4>{0, 4, 2, 5}
                                                  : std::array<std::size_t, 4>{0, 1, 2, 3};
    camera.fx_px = numbers[places[0]];
    camera.fy_px = numbers[places[1]];
    camera.cx_px = numbers[places[2]];
    camera.cy_px = numbers[places[3]];
    if (!(camera.fx_px >= 1e-3) || !(camera.fy_px >= 1e-3)) {
      return refuse(key, fmt::format("expected positive focal lengths, found {} and {}",
                                     camera.fx_px, camera.fy_px));
    }
    status = check_center(camera);
    return status ? status : refuse(key, status.error().message);
  }

  Status set_distortion(Lens& lens) const {
    const std::string_view model = model_name(distortion_model_);
    std::vector<double> numbers = distortion_coefficients_;
    if (model.empty()) {
      return missing("distortion_model: none, radial-tangential or equidistant");
    }
    const char* key = coefficients_key();
    if (format_.has_matrix) {  // written with the zeros of models that have more
      const std::size_t least = model == "equidistant" ? 4U : 5U;
      while (numbers.size() > least && numbers.back() == 0.0) {
        numbers.pop_back();
      }
    }
    Status status;
    if (model == "none") {
      lens.distortion = Distortion::kNone;
      status = check_length(key, numbers, {0}, "[] for distortion_model none");
    } else if (model == "equidistant") {
      lens.distortion = Distortion::kEquidistant;
      status = check_length(key, numbers, {4}, "[k1, k2, k3, k4]");
    } else {
      lens.distortion = Distortion::kRadialTangential;
      status = check_length(key, numbers, {4, 5}, "[k1, k2, p1, p2] or [k1, k2, p1, p2, k3]");
    }
    if (status) {
      std::copy(numbers.begin(), numbers.end(), lens.coefficients.begin());
    }
    return status;
  }

  /// [R | t] of 12 numbers, or 16 with a last row that is not looked at.
  Status set_body(std::optional<Rigid3>& body_from_camera) const {
    if (transform_.empty()) {
      return {};
    }
    const char* key = format_.is_kalibr ? "T_cam_imu" : "T_BS";
    if (const Status status = check_length(key, transform_, {12, 16}, "16 numbers"); !status) {
      return status;
    }
    const Matrix34d matrix =
        Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>(transform_.data());
    const Eigen::Matrix3d rotation = matrix.leftCols<3>();
    constexpr double kTolerance = 1e-3;
    if (!(rotation.transpose() * rotation).isIdentity(kTolerance) || rotation.determinant() < 0.0) {
      return refuse(key, "expected a rotation in the first three columns, found none");
    }
    const Rigid3 transform = Rigid3::from_matrix(matrix);
    body_from_camera = format_.is_kalibr ? transform.inverse() : transform;
    return {};
  }

  [[nodiscard]] const char* coefficients_key() const {
    return format_.is_kalibr ? "distortion_coeffs" : "distortion_coefficients";
  }

  std::vector<Field> fields() {
    const Rule side = Rule::between(1.0, kMaxImageSide_px);
    const Rule distortion =
        format_.has_matrix ? Rule::one_of({"plumb_bob", "equidistant", "fisheye", "none"})
                           : Rule::one_of({"none", "radial-tangential", "radtan", "equidistant"});
    const char* intrinsics_key = format_.has_matrix ? "camera_matrix" : "intrinsics";
    return {
        {"", "image_width", &width_px_, side, ""},
        {"", "image_height", &height_px_, side, ""},
        {"", "resolution", &resolution_, side, ""},
        {"", "camera_model", &camera_model_, Rule::one_of({"pinhole"}), ""},
        {"", intrinsics_key, &intrinsics_, Rule::between(-1e6, 1e6), ""},
        {"", "distortion_model", &distortion_model_, distortion, ""},
        {"", coefficients_key(), &distortion_coefficients_, Rule::between(-1e4, 1e4), ""},
        {"", format_.is_kalibr ? "T_cam_imu" : "T_BS", &transform_, Rule::between(-1e6, 1e6), ""},
        {"", "rate_hz", &rate_hz_, Rule::between(1e-9, 1e5), ""},
        {"", "camera_height", &camera_height_m_, Rule::between(1e-9, 1000.0), ""}};
  }

  std::filesystem::path file_;
  CameraFormat format_;
  YAML::Node root_;
  // What the keys say; as here where they are absent.
  int width_px_ = 0;
  int height_px_ = 0;
  std::vector<double> resolution_;
  std::string camera_model_;
  std::vector<double> intrinsics_;
  std::string distortion_model_;
  std::vector<double> distortion_coefficients_;
  std::vector<double> transform_;
  double rate_hz_ = 0.0;
  double camera_height_m_ = 0.0;
};

}  // namespace

Expected<CameraFile> read_camera_file(const std::filesystem::path& file) {
  return Reader(file).read();
}

}  // namespace stemvo::dataset
