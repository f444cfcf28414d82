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

struct CameraFile {
  Camera camera;
  std::optional<double> rate_hz;
  std::optional<double> camera_height_m;   ///< above the road
  std::optional<Rigid3> body_from_camera;  ///< EuRoC's T_BS, or of Kalibr's T_cam_imu
  double imu_from_camera_s = 0.0;          ///< added to a frame's time, the gyro's (Kalibr)
  std::vector<std::string> warnings;       ///< what may be meant otherwise
};

/// The format is told by its keys: ours (`stemvo run --help`), with T_BS EuRoC's sensor.yaml;
/// Kalibr's camchain.yaml (cam0), OpenCV's FileStorage, ROS' camera_info or its message as `topic
/// echo` prints it, whose further keys are not read. cameras.txt is COLMAP's. Errors, naming file
/// and line: unreadable, not YAML, a key missing, unknown or twice, a value that cannot be, ROS'
/// roi or binning, skew, a camera that check_camera refuses.
[[nodiscard]] Expected<CameraFile> read_camera_file(const std::filesystem::path& file);
/// COLMAP's cameras.txt of one camera.
[[nodiscard]] Expected<CameraFile> read_colmap_camera(const std::filesystem::path& file);

[[nodiscard]] std::string camera_file_text(const CameraFile& file);

}  // namespace stemvo::dataset
