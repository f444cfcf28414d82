// SPDX-License-Identifier: MIT
#include "dataset/camera_file.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <yaml-cpp/yaml.h>

#include "config/config_yaml.hpp"
#include "evaluation/trajectory.hpp"
#include "geometry/distortion.hpp"
#include "odometry/check_frame.hpp"
#include "text/text_file.hpp"
#include "try.hpp"

namespace stemvo::dataset {
namespace {

/// The names by which a kind of camera file says what ours says.
struct Format {
  std::string width = "image_width";
  std::string height = "image_height";
  std::string intrinsics = "intrinsics";
  std::string coefficients = "distortion_coefficients";
  std::string body = "T_BS";
  std::string projection = {};
  std::string intrinsics_form = "[fx, fy, cx, cy]";
  bool is_of_matrices = false;  ///< nine intrinsics, row by row
  bool has_more_keys = false;   ///< else a key that is not read is an error

  [[nodiscard]] std::vector<std::string> keys() const {
    std::vector<std::string> keys = {
        width,        height, "resolution", "camera_model", intrinsics, "distortion_model",
        coefficients, body,   "rate_hz",    "camera_height"};
    if (is_of_matrices) {
      keys.insert(keys.end(), {projection, "roi", "binning_x", "binning_y", "fisheye_model"});
    } else if (has_more_keys) {
      keys.push_back("timeshift_cam_imu");
    }
    return keys;
  }
};

const Format kKalibr = {
    .coefficients = "distortion_coeffs", .body = "T_cam_imu", .has_more_keys = true};

/// OpenCV's and ROS'.
const Format kMatrices = {.intrinsics = "camera_matrix",
                          .projection = "projection_matrix",
                          .intrinsics_form = "data: [fx, 0, cx, 0, fy, cy, 0, 0, 1]",
                          .is_of_matrices = true,
                          .has_more_keys = true};

/// ROS' message as `topic echo` prints it: k, d and p, in ROS 1 K, D and P.
Format message(const char* k, const char* d, const char* p) {
  return {"width", "height", k, d, "T_BS", p, "[fx, 0, cx, 0, fy, cy, 0, 0, 1]", true, true};
}

Format format_of(const YAML::Node& map) {
  return map["cam0"] && map["cam0"].IsMap() ? kKalibr
         : map["camera_matrix"]             ? kMatrices
         : map["k"]                         ? message("k", "d", "p")
         : map["K"]                         ? message("K", "D", "P")
                                            : Format();
}

/// Adds the numbers of a list, or of a list of rows (Kalibr's matrices).
Status add_numbers(const YAML::Node& list, bool may_have_rows, std::vector<double>& numbers) {
  constexpr std::size_t kMost = 16;
  for (const YAML::Node& element : list) {
    if (may_have_rows && element.IsSequence()) {
      STEMVO_TRY(add_numbers(element, false, numbers));
    } else {
      STEMVO_TRY_GET(const auto one, parse_numbers(element.IsScalar() ? element.Scalar() : "", 1));
      numbers.push_back(one.front());
    }
    if (numbers.size() > kMost) {
      return fail(fmt::format("expected at most {} numbers, found more", kMost));
    }
  }
  return {};
}

/// Reads values; the first that is wrong is the error, those behind it are as if absent.
class Reader {
 public:
  explicit Reader(const std::filesystem::path& file) : file_(file) {}

  Expected<CameraFile> read() {
    STEMVO_TRY(collect());
    CameraFile result;
    set_body(result.body_from_camera);
    set_size(result.camera);
    set_intrinsics(result.camera);
    set_distortion(result.camera);
    check_part(result.camera);
    check_projection(result.camera);
    result.rate_hz = number("rate_hz", 1e-9, 1e5);
    result.camera_height_m = number("camera_height", 1e-9, 1000.0);
    result.imu_from_camera_s = number("timeshift_cam_imu", -10.0, 10.0).value_or(0.0);
    result.warnings = warnings_;
    return status_ ? Expected<CameraFile>(result) : status_.error();
  }

 private:
  Status collect() {
    STEMVO_TRY_GET(std::string text, read_text_file(file_, kMaxSettings_MB));
    if (text.starts_with("%YAML:")) {
      text.front() = '#';  // OpenCV writes "%YAML:1.0", which is not YAML: read as a comment
    }
    if (text.ends_with("\n---\n")) {  // behind each message that ROS prints
      text.resize(text.size() - 4);
    }
    STEMVO_TRY_GET(const YAML::Node root, config::parse_document(text, file_.string()));
    if (root.IsNull()) {
      return {};
    }
    if (!root.IsMap()) {
      return fail_at(file_, 0, fail("expected keys with values, found none"));
    }
    format_ = format_of(root);
    if (root["image_width"]) {  // K and D beside it are another program's
      format_.width = Format().width;
      format_.height = Format().height;
    }
    const bool is_chain = format_.body == kKalibr.body;
    if (is_chain && root["cam1"]) {
      const YAML::Node topic = root["cam0"]["rostopic"];
      warnings_.push_back(fmt::format("{}: of several cameras cam0{} is taken", file_.string(),
                                      topic ? " (" + one_line(topic.Scalar()) + ")" : ""));
    }
    return collect_keys(is_chain ? root["cam0"] : root);
  }
  Status collect_keys(const YAML::Node& map) {
    const std::vector<std::string> known = format_.keys();
    for (const auto& entry : map) {
      const YAML::Node& value = entry.second;
      const std::string key = entry.first.IsScalar() ? entry.first.Scalar() : "";
      if (std::ranges::find(known, key) != known.end()) {
        const bool is_matrix = value.IsMap() && value["data"];  // {rows, cols, data: [..]}
        if (!values_.emplace(key, is_matrix ? value["data"] : value).second) {
          return at(entry.first, key + ": duplicated key");
        }
      } else if (!format_.has_more_keys && key != "sensor_type" && key != "comment") {  // EuRoC's
        return at(entry.first, fmt::format("{}: unknown key; known keys: {}", one_line(key),
                                           fmt::join(known, ", ")));
      }
    }
    return {};
  }

  [[nodiscard]] Error at(const YAML::Node& node, const std::string& problem) const {
    return fail_at(file_, static_cast<std::size_t>(node.Mark().line), fail(problem));
  }
  [[nodiscard]] bool has(const std::string& key) const { return values_.contains(key); }
  void refuse(const Error& error) { status_ = status_ ? Status(error) : status_; }
  void refuse(const std::string& key, const std::string& problem) {
    refuse(at(values_.at(key), key + ": " + problem));
  }
  void miss(const std::string& expected) {
    refuse(fail(fmt::format("{}: expected {}, found no such key", file_.string(), expected)));
  }

  /// One value as text; empty: there is no such key.
  std::string scalar(const std::string& key) {
    if (has(key) && !values_.at(key).IsScalar()) {
      refuse(key, "expected one value, found none or several");
    }
    return has(key) && values_.at(key).IsScalar() ? values_.at(key).Scalar() : "";
  }
  std::optional<double> number(const std::string& key, double min, double max) {
    const std::string text = scalar(key);
    const auto numbers = parse_numbers(text, 1);
    const bool is_inside = numbers && numbers->front() >= min && numbers->front() <= max;
    if (has(key) && !is_inside) {
      refuse(key, fmt::format("expected a number from {} to {}, found {}", min, max, text));
    }
    return is_inside ? std::optional(numbers->front()) : std::nullopt;
  }
  int side(const std::string& key, double given) {
    const bool is_side = given == std::floor(given) && given >= 1.0 && given <= kMaxImageSide_px;
    if (has(key) && !is_side) {
      refuse(key,
             fmt::format("expected whole pixels from 1 to {}, found {}", kMaxImageSide_px, given));
    }
    return is_side ? static_cast<int>(given) : 0;
  }
  std::string choice(const std::string& key, const std::vector<std::string>& choices) {
    std::string text = scalar(key);
    if (has(key) && std::ranges::find(choices, text) == choices.end()) {
      refuse(key, fmt::format("expected one of {}, found '{}'", fmt::join(choices, ", "), text));
    }
    return text;
  }
  /// A list of one of these lengths; with 0 among them it may be absent. `expected` names them.
  std::vector<double> list(const std::string& key,
                           const std::vector<std::size_t>& lengths,
                           const std::string& expected) {
    std::vector<double> numbers;
    if (!has(key)) {
      if (std::ranges::find(lengths, 0U) == lengths.end()) {
        miss(key + ": " + expected);
      }
    } else if (!values_.at(key).IsSequence()) {
      refuse(key, fmt::format("expected a list of numbers, found '{}'", scalar(key)));
    } else if (const Status read = add_numbers(values_.at(key), true, numbers); !read) {
      refuse(key, read.error().message);
    } else {
      const std::size_t count = numbers.size();
      // OpenCV and ROS write coefficients with the zeros of models that have more.
      while (key == format_.coefficients && numbers.size() > lengths.back() &&
             numbers.back() == 0.0) {
        numbers.pop_back();
      }
      if (std::ranges::find(lengths, numbers.size()) == lengths.end()) {
        refuse(key, fmt::format("expected {}, found {} numbers", expected, count));
      }
    }
    return numbers;
  }
  /// Nullopt: there is no list of numbers.
  std::optional<std::vector<double>> readable_list(const std::string& key) const {
    std::vector<double> numbers;
    return has(key) && values_.at(key).IsSequence() && add_numbers(values_.at(key), true, numbers)
               ? std::optional(numbers)
               : std::nullopt;
  }

  void set_size(Camera& camera) {
    const std::string& width = format_.width;
    const std::string& height = format_.height;
    if (has(width) != has(height)) {
      refuse(fail(fmt::format("{}: expected {} and {}, found {} alone", file_.string(), width,
                              height, has(width) ? width : height)));
    } else if (has(width)) {
      camera.width_px = side(width, number(width, 1.0, kMaxImageSide_px).value_or(1.0));
      camera.height_px = side(height, number(height, 1.0, kMaxImageSide_px).value_or(1.0));
    } else if (!has("resolution")) {
      miss(fmt::format("{} and {}, or resolution: [width, height]", width, height));
    } else if (const auto sides = list("resolution", {2}, "[width, height]"); status_) {
      camera.width_px = side("resolution", sides[0]);
      camera.height_px = side("resolution", sides[1]);
    }
    choice("camera_model", {"pinhole"});
  }

  void set_intrinsics(Camera& camera) {
    const std::string& key = format_.intrinsics;
    const auto n = list(key, {format_.is_of_matrices ? 9U : 4U}, format_.intrinsics_form);
    if (!status_) {
      return;
    }
    const bool is_matrix = format_.is_of_matrices;
    camera.fx_px = n[0];
    camera.fy_px = n[is_matrix ? 4 : 1];
    camera.cx_px = n[2];
    camera.cy_px = n[is_matrix ? 5 : 3];
    if (is_matrix && (n[1] != 0.0 || n[3] != 0.0 || n[6] != 0.0 || n[7] != 0.0 || n[8] != 1.0)) {
      refuse(key, fmt::format("expected {} without skew, found [{}]", format_.intrinsics_form,
                              fmt::join(n, ", ")));
    }
    if (const Status status = check_camera(camera, key); !status) {
      refuse(at(values_.at(key), status.error().message));
    }
  }

  /// ROS' K is of the whole sensor, the images may be of a part of it.
  void check_part(const Camera& camera) {
    for (const char* key : {"binning_x", "binning_y"}) {
      if (number(key, 0.0, 1e5).value_or(0.0) > 1.0) {
        refuse(key, fmt::format("expected 0 or 1, for K is of all pixels, found {}", scalar(key)));
      }
    }
    if (!has("roi") || values_.at("roi").IsNull()) {
      return;
    }
    const YAML::Node& roi = values_.at("roi");
    const int whole[] = {0, 0, camera.width_px, camera.height_px};
    bool is_whole = roi.IsMap() || (roi.IsSequence() && roi.size() == 4);
    for (std::size_t i = 0; is_whole && i < 4; ++i) {
      constexpr const char* kKeys[] = {"x_offset", "y_offset", "width", "height"};
      const YAML::Node found = roi.IsMap() ? roi[kKeys[i]] : roi[i];
      const std::string text = found && found.IsScalar() ? found.Scalar() : "";
      is_whole = !found || text == "0" || text == std::to_string(whole[i]);
    }
    if (!is_whole) {
      refuse("roi", "expected the whole image, for K is of that, found a part");
    }
  }

  /// ROS' P is the camera of rectified images, which have no distortion.
  void check_projection(const Camera& camera) {
    const std::string& key = format_.projection;
    const auto numbers = readable_list(key);
    if (!status_ || !numbers || numbers->size() != 12) {
      return;
    }
    const auto& p = *numbers;
    const Eigen::Array4d off =
        Eigen::Array4d(p[0], p[5], p[2], p[6]) -
        Eigen::Array4d(camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px);
    if (p[0] > 0.0 && is_distorted(camera) && !(off.abs() < 0.01).all()) {
      warnings_.push_back(fmt::format(
          "{}: taken for images as the sensor gives them ({} and {}); those that are rectified "
          "have intrinsics [{}, {}, {}, {}], of {}, and no distortion",
          file_.string(), format_.intrinsics, format_.coefficients, p[0], p[5], p[2], p[6], key));
    }
  }

  void set_distortion(Camera& camera) {
    const std::string& key = format_.coefficients;
    // ROS names no model where there is no lens.
    const auto found = readable_list(key);
    const bool has_none = format_.is_of_matrices && found &&
                          std::ranges::all_of(*found, [](double k) { return k == 0.0; });
    const bool is_unnamed = format_.is_of_matrices && scalar("distortion_model").empty();
    const std::string fisheye = scalar("fisheye_model");  // OpenCV's, in place of a name
    std::string model =
        is_unnamed && (has_none || !has("distortion_model"))
            ? (!fisheye.empty() && fisheye != "0" ? "fisheye" : "plumb_bob")
            : choice("distortion_model", {"none", "radial-tangential", "radtan", "plumb_bob",
                                          "rational_polynomial", "equidistant", "fisheye"});
    const bool is_empty = has_none && found->empty();
    std::vector<double> numbers;
    if (model.empty()) {
      miss("distortion_model: none, radial-tangential or equidistant");
    } else if (model == "none" || is_empty) {
      list(key, {0}, "[] for distortion_model none");
    } else if (model == "equidistant" || model == "fisheye") {
      camera.distortion = Distortion::kEquidistant;
      numbers = list(key, {4}, "[k1, k2, k3, k4]");
    } else {
      camera.distortion = Distortion::kRadialTangential;
      numbers = model == "plumb_bob" && !is_unnamed
                    ? list(key, {4, 5}, "[k1, k2, p1, p2] or [k1, k2, p1, p2, k3]")
                    : list(key, {4, 5, 8, 12},
                           "[k1, k2, p1, p2] or [k1, k2, p1, p2, k3], maybe k4, k5, k6 and s1 to "
                           "s4 behind");
    }
    if (is_unnamed && fisheye.empty() && !has_none && numbers.size() == 4) {
      warnings_.push_back(fmt::format(
          "{}: {} without a model's name are taken for k1, k2, p1, p2; a fisheye's need "
          "distortion_model: equidistant",
          file_.string(), key));
    }
    if (status_) {
      std::ranges::copy(numbers, camera.distortion_coefficients.begin());
    }
  }

  /// [R | t] of 12 numbers, or 16 with 0, 0, 0, 1 behind: columns in place of rows have t there.
  void set_body(std::optional<Rigid3>& body_from_camera) {
    const std::string& key = format_.body;
    const auto numbers = list(key, {0, 12, 16}, "16 numbers");
    if (!status_ || numbers.empty()) {
      return;
    }
    if (numbers.size() == 16 &&
        std::vector(numbers.end() - 4, numbers.end()) != std::vector{0.0, 0.0, 0.0, 1.0}) {
      return refuse(key, fmt::format("expected a last row 0, 0, 0, 1, found {}",
                                     fmt::join(numbers.end() - 4, numbers.end(), ", ")));
    }
    const Expected<Rigid3> transform = pose_from_rows(numbers);
    if (!transform) {
      return refuse(key, transform.error().message);
    }
    body_from_camera = key == kKalibr.body ? transform->inverse() : *transform;
  }

  std::filesystem::path file_;
  Format format_;
  std::vector<std::string> warnings_;
  std::map<std::string, YAML::Node> values_;  ///< of the camera's keys that are there
  Status status_;
};

}  // namespace

Expected<CameraFile> read_camera_file(const std::filesystem::path& file) {
  return file.filename() == "cameras.txt" ? read_colmap_camera(file) : Reader(file).read();
}

}  // namespace stemvo::dataset
