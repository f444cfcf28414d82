// SPDX-License-Identifier: MIT
#include "dataset/camera_formats.hpp"

#include <algorithm>
#include <initializer_list>
#include <utility>
#include <vector>

namespace stemvo::dataset {
namespace {

/// A matrix {rows, cols, data: [..]}, or Kalibr's list of rows, becomes the list of its numbers.
void flatten(YAML::Node map, const char* key) {
  const YAML::Node value = std::as_const(map)[key];  // the other [] makes what is not there
  if (!value) {
    return;
  }
  if (value.IsMap() && value["data"]) {
    map[key] = value["data"];
  } else if (value.IsSequence() && value.size() > 0 &&
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

void keep_only(YAML::Node map, std::initializer_list<std::string_view> known) {
  std::vector<std::string> others;
  for (const auto& entry : map) {
    const std::string key = entry.first.IsScalar() ? entry.first.Scalar() : "";
    if (std::find(known.begin(), known.end(), key) == known.end()) {
      others.push_back(key);
    }
  }
  for (const std::string& key : others) {
    map.remove(key);
  }
}

CameraFormat read_kalibr(const YAML::Node& camera) {
  flatten(camera, "T_cam_imu");
  keep_only(camera, {"camera_model", "intrinsics", "distortion_model", "distortion_coeffs",
                     "resolution", "T_cam_imu", "rate_hz", "camera_height"});
  return {.is_kalibr = true, .implied_model = "", .keys = camera};
}

CameraFormat read_matrices(const YAML::Node& root) {
  CameraFormat format;
  format.has_matrix = true;
  format.keys = root;
  if (!root["distortion_model"]) {
    const YAML::Node fisheye = root["fisheye_model"];
    const bool is_fisheye = fisheye && fisheye.IsScalar() && fisheye.Scalar() != "0";
    format.implied_model = is_fisheye ? "equidistant" : "radial-tangential";
  }
  flatten(root, "camera_matrix");
  flatten(root, "distortion_coefficients");
  keep_only(root, {"image_width", "image_height", "camera_matrix", "distortion_model",
                   "distortion_coefficients", "rate_hz", "camera_height"});
  return format;
}

}  // namespace

CameraFormat format_of_camera(const YAML::Node& root) {
  if (root.IsMap() && root["cam0"] && root["cam0"].IsMap()) {
    return read_kalibr(root["cam0"]);
  }
  if (root.IsMap() && root["camera_matrix"]) {
    return read_matrices(root);
  }
  CameraFormat ours;
  ours.keys = root;
  if (root.IsMap()) {
    YAML::Node keys = root;
    keys.remove("sensor_type");
    keys.remove("comment");
    flatten(keys, "T_BS");
  }
  return ours;
}

std::string_view model_name(std::string_view name) {
  if (name == "radtan" || name == "plumb_bob") {
    return "radial-tangential";
  }
  return name == "fisheye" ? "equidistant" : name;
}

}  // namespace stemvo::dataset
