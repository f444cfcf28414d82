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
#include "dataset/frame_files.hpp"
#include "text/text_file.hpp"

namespace stemvo::dataset {
namespace {

using options::Field;
using options::Rule;

/// How a kind of camera file says what ours says.
struct Format {
  std::string_view width = "image_width";
  std::string_view height = "image_height";
  std::string_view intrinsics = "intrinsics";
  std::size_t num_intrinsics = 4;
  std::string_view intrinsics_form = "[fx, fy, cx, cy]";
  std::array<std::size_t, 4> places = {0, 1, 2, 3};  ///< of fx, fy, cx, cy among them
  std::string_view coefficients = "distortion_coefficients";
  std::vector<std::string_view> models = {"none", "radial-tangential", "radtan", "equidistant"};
  std::string_view body = "T_BS";
  std::vector<const char*> matrices = {"T_BS"};  ///< keys whose value may be one
  std::vector<std::string_view> known = {};      ///< all that is read; empty: what else is there
                                                 ///< is an error
};

const Format kKalibr = {
    .coefficients = "distortion_coeffs",
    .body = "T_cam_imu",
    .matrices = {"T_cam_imu"},
    .known = {"camera_model", "intrinsics", "distortion_model", "distortion_coeffs", "resolution",
              "T_cam_imu", "rate_hz", "camera_height"}};

/// OpenCV's and ROS'.
const Format kMatrices = {
    .intrinsics = "camera_matrix",
    .num_intrinsics = 9,
    .intrinsics_form = "data: [fx, 0, cx, 0, fy, cy, 0, 0, 1]",
    .places = {0, 4, 2, 5},
    .models = {"plumb_bob", "equidistant", "fisheye", "none"},
    .matrices = {"camera_matrix", "distortion_coefficients"},
    .known = {"image_width", "image_height", "camera_matrix", "distortion_model",
              "distortion_coefficients", "rate_hz", "camera_height"}};

/// ROS' message as `topic echo` prints it; capitals in ROS 1.
const Format kMessage = {.width = "width",
                         .height = "height",
                         .intrinsics = "k",
                         .num_intrinsics = 9,
                         .intrinsics_form = "[fx, 0, cx, 0, fy, cy, 0, 0, 1]",
                         .places = kMatrices.places,
                         .coefficients = "d",
                         .models = kMatrices.models,
                         .matrices = {},
                         .known = {"width", "height", "k", "K", "distortion_model", "d", "D"}};

/// A matrix {rows, cols, data: [..]}, or Kalibr's list of rows, becomes the list of its numbers.
void flatten(YAML::Node map, const char* key) {
  constexpr std::size_t kMaxRows = 4;                // aliases of one may be many
  const YAML::Node value = std::as_const(map)[key];  // the other [] makes what is not there
  if (!value) {
    return;
  }
  if (value.IsMap() && value["data"]) {
    map[key] = value["data"];
  } else if (value.IsSequence() && value.size() > 0 && value.size() <= kMaxRows &&
             std::all_of(value.begin(), value.end(),
                         [](const YAML::Node& row) { return row.IsSequence(); })) {
    std::vector<YAML::Node> others;  // first of all: a row may be an alias of the first
    for (std::size_t row = 1; row < value.size(); ++row) {
      for (const YAML::Node& number : value[row]) {
        others.push_back(number);
      }
    }
    YAML::Node numbers = value[0];  // which has a line
    for (const YAML::Node& number : others) {
      numbers.push_back(number);
    }
    map[key] = numbers;
  }
}

/// What is left of a map; a key that is there twice stays so.
YAML::Node only(const YAML::Node& map, const std::vector<std::string_view>& known) {
  YAML::Node kept(YAML::NodeType::Map);
  for (const auto& entry : map) {
    const std::string key = entry.first.IsScalar() ? entry.first.Scalar() : "";
    if (std::find(known.begin(), known.end(), key) != known.end()) {
      kept.force_insert(entry.first, entry.second);
    }
  }
  return kept;
}

/// Our name for a model of distortion; a name that is not known stays.
std::string_view model_name(std::string_view name) {
  if (name == "radtan" || name == "plumb_bob") {
    return "radial-tangential";
  }
  return name == "fisheye" ? "equidistant" : name;
}

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
    Expected<std::string> text = read_text_file(file_, kMaxSettings_MB);
    if (!text) {
      return text.error();
    }
    if (text->starts_with("%YAML:")) {
      text->front() = '#';  // OpenCV writes "%YAML:1.0", which is not YAML: read as a comment
    }
    if (text->ends_with("\n---\n")) {  // behind each message that ROS prints
      text->resize(text->size() - 4);
    }
    Expected<YAML::Node> root = config::parse_document(*text, file_.string());
    if (!root) {
      return root.error();
    }
    choose_format(*root);
    std::vector<Field> fields = this->fields();
    return config::read_document(root_, file_.string(), fields);
  }

  /// Also takes from the camera's keys what is not read, and makes lists of its matrices.
  void choose_format(const YAML::Node& root) {
    const bool is_map = root.IsMap();
    if (is_map && root["cam0"] && root["cam0"].IsMap()) {
      format_ = kKalibr;
      root_ = root["cam0"];
    } else {
      root_ = root;
      format_ = !is_map                  ? Format()
                : root["camera_matrix"]  ? kMatrices
                : root["k"] || root["K"] ? kMessage
                                         : Format();
      if (is_map && root["K"]) {
        format_.intrinsics = "K";
        format_.coefficients = "D";
      }
    }
    if (is_of_matrices() && !root["distortion_model"]) {
      const YAML::Node fisheye = root["fisheye_model"];
      const bool is_fisheye = fisheye && fisheye.IsScalar() && fisheye.Scalar() != "0";
      distortion_model_ = is_fisheye ? "equidistant" : "radial-tangential";
    }
    if (!is_map) {
      return;
    }
    for (const char* key : format_.matrices) {
      flatten(root_, key);
    }
    if (!format_.known.empty()) {
      root_.reset(only(root_, format_.known));
    } else {
      root_.remove("sensor_type");  // EuRoC's
      root_.remove("comment");
    }
  }
  [[nodiscard]] bool is_of_matrices() const { return format_.num_intrinsics == 9; }

  [[nodiscard]] YAML::Node value_of(std::string_view key) const { return root_[std::string(key)]; }
  [[nodiscard]] Error missing(std::string_view expected) const {
    return fail(fmt::format("{}: expected {}, found no such key", file_.string(), expected));
  }
  /// "<file>:<line>: <key>: <problem>"
  [[nodiscard]] Error refuse(std::string_view key, const std::string& problem) const {
    return fail(fmt::format("{}: {}: {}",
                            at_line(file_, static_cast<std::size_t>(value_of(key).Mark().line) + 1),
                            key, problem));
  }
  /// Whether a list has one of these lengths; `expected` names them.
  [[nodiscard]] Status check_length(std::string_view key,
                                    const std::vector<double>& numbers,
                                    const std::vector<std::size_t>& lengths,
                                    std::string_view expected) const {
    const bool may_be_absent = std::count(lengths.begin(), lengths.end(), 0U) != 0;
    if (!root_.IsMap() || !value_of(key)) {
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
      return fail(fmt::format("{}: expected {} and {}, found {} alone", file_.string(),
                              format_.width, format_.height,
                              width_px_ == 0 ? format_.height : format_.width));
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
    const std::string_view key = format_.intrinsics;
    const std::vector<double>& numbers = intrinsics_;
    Status status = check_length(key, numbers, {format_.num_intrinsics}, format_.intrinsics_form);
    if (!status) {
      return status;
    }
    const auto& places = format_.places;
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
    const std::string_view key = format_.coefficients;
    if (is_of_matrices()) {  // written with the zeros of models that have more
      const std::size_t least = model == "equidistant" ? 4U : 5U;
      while (numbers.size() > least && numbers.back() == 0.0) {
        numbers.pop_back();
      }
    }
    Status status;
    if (model == "none" || (is_of_matrices() && numbers.empty() && value_of(key))) {
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
    const std::string_view key = format_.body;
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
    body_from_camera = key == kKalibr.body ? transform.inverse() : transform;
    return {};
  }

  std::vector<Field> fields() {
    const Rule side = Rule::between(1.0, kMaxImageSide_px);
    return {{"", format_.width, &width_px_, side, ""},
            {"", format_.height, &height_px_, side, ""},
            {"", "resolution", &resolution_, side, ""},
            {"", "camera_model", &camera_model_, Rule::one_of({"pinhole"}), ""},
            {"", format_.intrinsics, &intrinsics_, Rule::between(-1e6, 1e6), ""},
            {"", "distortion_model", &distortion_model_, Rule::one_of(format_.models), ""},
            {"", format_.coefficients, &distortion_coefficients_, Rule::between(-1e4, 1e4), ""},
            {"", format_.body, &transform_, Rule::between(-1e6, 1e6), ""},
            {"", "rate_hz", &rate_hz_, Rule::between(1e-9, 1e5), ""},
            {"", "camera_height", &camera_height_m_, Rule::between(1e-9, 1000.0), ""}};
  }

  std::filesystem::path file_;
  Format format_;
  YAML::Node root_;  ///< the camera's keys; lines are those of the file
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
