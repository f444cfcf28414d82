// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "dataset/sequence.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/error.hpp"

namespace stemvo {

/// Everything `stemvo calibrate` was asked for.
struct CalibrationRequest {
  std::filesystem::path sequence_dir;
  std::filesystem::path out_file;
  Config config;                                     ///< of the odometry that learns the camera
  std::optional<FrameRangeRequest> frames;           ///< else all
  std::optional<std::filesystem::path> calibration;  ///< to start from; else the folder's calib.txt
};

/// One number of the calibration.
struct CalibratedParameter {
  std::string name;
  double given = 0.0;
  double refined = 0.0;    ///< as given where it is not determined
  double sigma = 0.0;      ///< standard deviation
  double max_sigma = 0.0;  ///< more: not determined
  bool is_determined = false;
};

/// Camera parameters that a drive has determined.
struct CalibrationReport {
  Camera refined;
  /// Focal length, principal point x and y (px); k1 and k2, the radial distortion
  /// 1 + k1 r^2 + k2 r^4 (r on the plane z = 1) that the rectification left. The latter are
  /// estimated so that they do not end up in the focal length; calib.txt cannot hold them.
  std::array<CalibratedParameter, 5> parameters;
  int num_runs = 0;                   ///< of keyframes
  std::vector<std::string> warnings;  ///< unreadable frames and the like, one line each
  bool interrupted = false;           ///< no file is written
  bool written = false;               ///< false also where nothing is determined
};

/// After each frame: done, in all; false stops.
using CalibrationProgress = std::function<bool(std::size_t, std::size_t)>;

/// Focal length and principal point as the odometry learns them over a sequence
/// (`camera.refine: all`). Ground truth is never read. Writes out_file in KITTI's calib.txt format:
/// rows of cameras that share the refined camera's intrinsics get the new ones, their baselines
/// stay, other lines are kept. Same input, same bytes. Errors: those of the sequence and the model,
/// out_file that cannot be written or is the calibration itself, too few frames that move.
[[nodiscard]] Expected<CalibrationReport> calibrate_sequence(
    const CalibrationRequest& request, const CalibrationProgress& progress = {});

/// Given, refined, standard deviation; what they rest on.
[[nodiscard]] std::string format_calibration_table(const CalibrationReport& report);

}  // namespace stemvo
