// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "stemvo/camera.hpp"
#include "stemvo/error.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo::dataset {

/// Contents of a camera file.
struct CameraFile {
  Camera camera;
  std::optional<double> rate_hz;
  std::optional<double> camera_height_m;   ///< above the road
  std::optional<Rigid3> body_from_camera;  ///< EuRoC's T_BS, or of Kalibr's T_cam_imu
  std::vector<std::string> warnings;       ///< what may be meant otherwise

  [[nodiscard]] std::optional<Eigen::Quaterniond> camera_from_imu() const {
    return body_from_camera ? std::optional(body_from_camera->rotation.inverse()) : std::nullopt;
  }
};

/// The format is told by its keys. Ours is YAML with the keys image_width and image_height or
/// `resolution: [w, h]`, camera_model (pinhole, also where it is absent), intrinsics [fx, fy, cx,
/// cy], distortion_model (none, radial-tangential, equidistant, or others' names of them),
/// distortion_coefficients, and where known rate_hz and camera_height. EuRoC's sensor.yaml is one,
/// with T_BS (sensor_type and comment are not read). Others, whose further keys are not read:
/// Kalibr's camchain.yaml (cam0), OpenCV's FileStorage (camera_matrix, distortion_coefficients,
/// fisheye_model), ROS' camera_info (the same and distortion_model; or its message as `topic echo`
/// prints it: width, height, distortion_model, k and d, in ROS 1 K and D). cameras.txt is COLMAP's
/// Errors, naming file and line: unreadable, not YAML, a key missing, unknown or
/// twice, a value that cannot be, ROS' roi or binning, skew, a camera that check_camera refuses.
[[nodiscard]] Expected<CameraFile> read_camera_file(const std::filesystem::path& file);
/// COLMAP's cameras.txt of one camera.
[[nodiscard]] Expected<CameraFile> read_colmap_camera(const std::filesystem::path& file);

/// Our form of it.
[[nodiscard]] std::string camera_file_text(const CameraFile& file);

}  // namespace stemvo::dataset
