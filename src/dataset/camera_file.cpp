// SPDX-License-Identifier: MIT
#include "dataset/camera_file.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include "config/config_text.hpp"
#include "config/config_yaml.hpp"
#include "dataset/frame_files.hpp"
#include "text/text_file.hpp"

namespace stemvo::dataset {
namespace {

constexpr double kMaxSide_px = 32767;  // what OpenCV's maps hold
constexpr double kMaxRate_hz = 1e5;

/// OpenCV writes "%YAML:1.0", which is not YAML: read as a comment.
std::string without_opencv_directive(std::string text) {
  if (text.starts_with("%YAML:")) {
    text.front() = '#';
  }
  return text;
}

/// The values of a file by their keys; errors name file and line.
class Keys {
 public:
  static Expected<Keys> read(const std::filesystem::path& file) {
    std::error_code ignored;
    if (!std::filesystem::exists(file, ignored)) {
      return fail(fmt::format("{}: expected a camera file, found nothing", file.string()));
    }
    const Expected<std::string> text = read_text_file(file);
    if (!text) {
      return text.error();
    }
    const Expected<YAML::Node> root =
        config::parse_document(without_opencv_directive(*text), file.string());
    if (!root) {
      return root.error();
    }
    Keys keys(file);
    if (!root->IsMap()) {
      return fail(
          fmt::format("{}:{}: expected the keys of a camera (image_width, image_height, "
                      "intrinsics, ..), found none",
                      file.string(), std::max(root->Mark().line, 0) + 1));
    }
    for (const auto& entry : *root) {
      const std::string key = entry.first.IsScalar() ? entry.first.Scalar() : "";
      if (!keys.values_.emplace(key, entry.second).second) {
        return fail(fmt::format("{}:{}: {}: expected once, found twice", file.string(),
                                entry.first.Mark().line + 1, config::quote(key)));
      }
    }
    return keys;
  }

  [[nodiscard]] bool has(const std::string& key) const { return values_.contains(key); }
  [[nodiscard]] Error missing(std::string_view expected) const {
    return fail(fmt::format("{}: expected {}, found no such key", file_.string(), expected));
  }
  /// "<file>:<line>: <key>: <problem>"
  [[nodiscard]] Error refuse(const std::string& key, const std::string& problem) const {
    return fail(fmt::format("{}: {}", where(key), problem));
  }

  [[nodiscard]] Expected<std::string> word(const std::string& key) const {
    const YAML::Node& value = values_.at(key);
    if (!value.IsScalar()) {
      return refuse(key, "expected one word, found a list or nothing");
    }
    return value.Scalar();
  }
  [[nodiscard]] Expected<double> number(const std::string& key) const {
    const YAML::Node& value = values_.at(key);
    if (!value.IsScalar()) {
      return refuse(key, "expected a number, found a list or nothing");
    }
    return number_of(key, value);
  }
  /// Of one of these lengths; `expected` names them.
  [[nodiscard]] Expected<std::vector<double>> numbers(const std::string& key,
                                                      const std::vector<std::size_t>& counts,
                                                      std::string_view expected) const {
    const YAML::Node& value = values_.at(key);
    std::vector<double> result;
    for (const YAML::Node& element : value) {
      const Expected<double> number = number_of(key, element);
      if (!number) {
        return number.error();
      }
      result.push_back(*number);
    }
    if (!value.IsSequence() ||
        std::find(counts.begin(), counts.end(), result.size()) == counts.end()) {
      return refuse(key, value.IsSequence()
                             ? fmt::format("expected {}, found {} numbers", expected, result.size())
                             : fmt::format("expected {}, found no list", expected));
    }
    return result;
  }

 private:
  explicit Keys(std::filesystem::path file) : file_(std::move(file)) {}

  [[nodiscard]] std::string where(const std::string& key) const {
    const int line = values_.at(key).Mark().line;  // of the value; -1: nothing stands there
    return fmt::format("{}{}: {}", file_.string(), line < 0 ? "" : fmt::format(":{}", line + 1),
                       key);
  }
  [[nodiscard]] Expected<double> number_of(const std::string& key, const YAML::Node& value) const {
    return parse_finite(value.IsScalar() ? value.Scalar() : "a list", where(key));
  }

  std::filesystem::path file_;
  std::map<std::string, YAML::Node> values_;
};

Status read_size(const Keys& keys, Camera& camera) {
  const auto check = [&](const std::string& key, double found) -> Expected<int> {
    if (!(found >= 1.0 && found <= kMaxSide_px && found == std::floor(found))) {
      return keys.refuse(
          key, fmt::format("expected whole pixels from 1 to {}, found {}", kMaxSide_px, found));
    }
    return static_cast<int>(found);
  };
  const auto side = [&](const std::string& key) {
    return keys.number(key).and_then([&](double found) { return check(key, found); });
  };
  Expected<int> width;
  Expected<int> height;
  if (keys.has("image_width") && keys.has("image_height")) {
    width = side("image_width");
    height = side("image_height");
  } else if (keys.has("resolution")) {
    const auto sides = keys.numbers("resolution", {2}, "[width, height]");
    if (!sides) {
      return sides.error();
    }
    width = check("resolution", sides->front());
    height = check("resolution", sides->back());
  } else {
    return keys.missing("image_width and image_height, or resolution: [width, height]");
  }
  if (!width || !height) {
    return width ? height.error() : width.error();
  }
  camera.width_px = *width;
  camera.height_px = *height;
  return {};
}

Status read_intrinsics(const Keys& keys, Camera& camera) {
  if (keys.has("camera_model")) {
    const auto model = keys.word("camera_model");
    if (!model || *model != "pinhole") {
      return model ? keys.refuse("camera_model",
                                 fmt::format("expected pinhole, found {}", config::quote(*model)))
                   : model.error();
    }
  }
  if (!keys.has("intrinsics")) {
    return keys.missing("intrinsics: [fx, fy, cx, cy]");
  }
  const auto numbers = keys.numbers("intrinsics", {4}, "[fx, fy, cx, cy]");
  if (!numbers) {
    return numbers.error();
  }
  camera.fx_px = (*numbers)[0];
  camera.fy_px = (*numbers)[1];
  camera.cx_px = (*numbers)[2];
  camera.cy_px = (*numbers)[3];
  if (!(camera.fx_px > 0.0) || !(camera.fy_px > 0.0)) {
    return keys.refuse("intrinsics", fmt::format("expected positive focal lengths, found {} and {}",
                                                 camera.fx_px, camera.fy_px));
  }
  if (!has_center_inside(camera)) {
    return keys.refuse(
        "intrinsics",
        fmt::format("expected a principal point inside pictures of {}x{} pixels, found ({}, {})",
                    camera.width_px, camera.height_px, camera.cx_px, camera.cy_px));
  }
  return {};
}

Expected<Distortion> read_model(const Keys& keys) {
  constexpr std::string_view kKnown = "none, radial-tangential or equidistant";
  if (!keys.has("distortion_model")) {
    return keys.missing(fmt::format("distortion_model: {}", kKnown));
  }
  const auto name = keys.word("distortion_model");
  if (!name) {
    return name.error();
  }
  if (*name == "none") {
    return Distortion::kNone;
  }
  if (*name == "radial-tangential" || *name == "radtan") {
    return Distortion::kRadialTangential;
  }
  if (*name == "equidistant") {
    return Distortion::kEquidistant;
  }
  return keys.refuse("distortion_model",
                     fmt::format("expected {}, found {}", kKnown, config::quote(*name)));
}

Status read_distortion(const Keys& keys, Lens& lens) {
  constexpr const char* kKey = "distortion_coefficients";
  const auto model = read_model(keys);
  if (!model) {
    return model.error();
  }
  lens.distortion = *model;
  if (*model == Distortion::kNone && !keys.has(kKey)) {
    return {};
  }
  const auto read = [&](const std::vector<std::size_t>& counts,
                        std::string_view expected) -> Expected<std::vector<double>> {
    if (!keys.has(kKey)) {
      return keys.missing(fmt::format("{}: {}", kKey, expected));
    }
    return keys.numbers(kKey, counts, expected);
  };
  const auto numbers = *model == Distortion::kNone ? read({0}, "[] for distortion_model none")
                       : *model == Distortion::kEquidistant
                           ? read({4}, "[k1, k2, k3, k4]")
                           : read({4, 5}, "[k1, k2, p1, p2] or [k1, k2, p1, p2, k3]");
  if (!numbers) {
    return numbers.error();
  }
  std::copy(numbers->begin(), numbers->end(), lens.coefficients.begin());
  return {};
}

/// Absent, or positive and not above `max`.
Expected<std::optional<double>> read_positive(const Keys& keys,
                                              const std::string& key,
                                              double max,
                                              std::string_view unit) {
  if (!keys.has(key)) {
    return std::nullopt;
  }
  const auto number = keys.number(key);
  if (!number) {
    return number.error();
  }
  if (!(*number > 0.0 && *number <= max)) {
    return keys.refuse(
        key, fmt::format("expected {} above 0 and at most {}, found {}", unit, max, *number));
  }
  return *number;
}

}  // namespace

Expected<CameraFile> read_camera_file(const std::filesystem::path& file) {
  const Expected<Keys> keys = Keys::read(file);
  if (!keys) {
    return keys.error();
  }
  CameraFile result;
  Status status = read_size(*keys, result.lens.camera);
  status = status ? read_intrinsics(*keys, result.lens.camera) : status;
  status = status ? read_distortion(*keys, result.lens) : status;
  if (!status) {
    return status.error();
  }
  const auto rate_hz = read_positive(*keys, "rate_hz", kMaxRate_hz, "frames per second");
  const auto height_m = read_positive(*keys, "camera_height", 1000.0, "metres");
  if (!rate_hz || !height_m) {
    return rate_hz ? height_m.error() : rate_hz.error();
  }
  result.rate_hz = *rate_hz;
  result.camera_height_m = *height_m;
  return result;
}

}  // namespace stemvo::dataset
