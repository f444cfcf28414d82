// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <string_view>

#include <yaml-cpp/yaml.h>

namespace stemvo::dataset {

/// What the keys of a camera file are called.
struct CameraFormat {
  bool has_matrix = false;  ///< camera_matrix of 9 numbers in place of intrinsics
  bool is_kalibr = false;   ///< distortion_coeffs and T_cam_imu in place of our names
  /// Without distortion_model: OpenCV's, which is radial-tangential, or equidistant where
  /// fisheye_model is not 0.
  std::string implied_model;
  /// The camera's keys; matrices are lists of their numbers, and of other programs' files what is
  /// not read is gone. Lines are those of the file.
  YAML::Node keys;
};

/// Tells Kalibr's (a group cam0) from OpenCV's and ROS' (camera_matrix) and ours (anything else).
[[nodiscard]] CameraFormat format_of_camera(const YAML::Node& root);

/// Our name for a model of distortion: plumb_bob and radtan are radial-tangential, fisheye is
/// equidistant, ...; a name that is not known stays.
[[nodiscard]] std::string_view model_name(std::string_view name);

}  // namespace stemvo::dataset
