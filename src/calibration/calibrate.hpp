// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "dataset/frame_source.hpp"
#include "pipeline/run.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/error.hpp"

namespace stemvo {

/// Everything `stemvo calibrate` was asked for. The camera is that of `config`.
struct CalibrationRequest : FrameSourceRequest {
  std::filesystem::path out_file;
  Config config;  ///< of the odometry that drives
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

/// Camera parameters that a recording has determined.
struct CalibrationReport {
  Camera refined;  ///< of the frames as they come, with its lens
  /// Focal length, principal point x and y (px) of the frames as they are worked on; k1 and k2, the
  /// radial distortion 1 + k1 r^2 + k2 r^4 (r on the plane z = 1) that is left in them. calib.txt
  /// cannot hold the latter.
  std::array<CalibratedParameter, 5> parameters;
  std::size_t num_keyframes = 0;
  std::size_t num_landmarks = 0;
  double median_error_px = 0.0;       ///< of their reprojections
  bool is_kitti = false;              ///< the form of the file
  std::vector<std::string> warnings;  ///< of the recording, unreadable frames, ..
  bool interrupted = false;           ///< no file is written
  bool written = false;               ///< false also where nothing is determined
};

/// The camera that one adjustment of a whole recording finds (mapping/map_adjustment.hpp): any
/// recording that `run` takes. Ground truth is never read. Writes out_file; in KITTI's layout as
/// calib.txt: rows of cameras that share the refined camera's intrinsics get the new ones, their
/// baselines stay, other lines are kept; else as camera.yaml. Same input, same bytes. Errors: those
/// of the recording and the model, out_file that cannot be written or is an input, too few frames
/// that move.
[[nodiscard]] Expected<CalibrationReport> calibrate_sequence(const CalibrationRequest& request,
                                                             const RunProgress& progress = {});

/// Given, refined, standard deviation; what they rest on.
[[nodiscard]] std::string format_calibration_table(const CalibrationReport& report);

}  // namespace stemvo
