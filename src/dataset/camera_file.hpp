// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <optional>

#include "dataset/undistortion.hpp"
#include "stemvo/error.hpp"

namespace stemvo::dataset {

/// What a camera file says.
struct CameraFile {
  Lens lens;
  std::optional<double> rate_hz;
  std::optional<double> camera_height_m;  ///< above the road
};

/// YAML with the keys image_width and image_height or `resolution: [w, h]`, camera_model (pinhole,
/// also where it is absent), intrinsics [fx, fy, cx, cy], distortion_model (none,
/// radial-tangential or radtan, equidistant), distortion_coefficients, and where known rate_hz and
/// camera_height. EuRoC's sensor.yaml is one: its other keys (sensor_type, comment, T_BS) are not
/// read. Errors, naming file and line: unreadable, not YAML, a key missing, unknown or twice, a
/// value that cannot be.
[[nodiscard]] Expected<CameraFile> read_camera_file(const std::filesystem::path& file);

}  // namespace stemvo::dataset
