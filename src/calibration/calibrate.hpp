// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "calibration/board.hpp"
#include "config/config.hpp"
#include "dataset/frame_source.hpp"
#include "geometry/bundle.hpp"
#include "pipeline/run.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/error.hpp"

namespace stemvo {

struct CalibrationRequest : FrameSourceRequest {
  std::filesystem::path out_file;
  Config config;  ///< of the odometry that drives
};

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

[[nodiscard]] std::string format_calibration_table(const CalibrationReport& report);

/// The lens whose frames, once `lens` is taken out of them as `view` (geometry/distortion.hpp),
/// look as the view's camera changed by `change` shows the world. Of its distortion k1 and k2 are
/// fitted; a lens without distortion becomes one with OpenCV's k1 k2. fx / fy is kept.
[[nodiscard]] Camera refined_lens(const Camera& lens,
                                  const Camera& view,
                                  const IntrinsicsDelta& change);

struct BoardRequest {
  std::filesystem::path pictures;  ///< a folder, a pattern of images, a video
  std::filesystem::path out_file;  ///< camera.yaml
  Board board;
  std::string board_text;  ///< as it was given, for the file
};

struct BoardReport {
  BoardFit fit;
  std::vector<BoardView> views;      ///< that show the board
  std::size_t num_pictures = 0;      ///< that were looked at
  std::vector<std::string> missing;  ///< pictures to take next
  std::vector<std::string> warnings;
  std::filesystem::path coverage_file;  ///< beside out_file
  bool interrupted = false;             ///< no file is written
};

/// The camera by pictures of a printed board. Of a video views are taken that differ. Writes
/// out_file (with errors and sigmas as comments) and the picture of what is covered. Errors: no
/// pictures, under three with the board, files that cannot be written.
[[nodiscard]] Expected<BoardReport> calibrate_board(const BoardRequest& request,
                                                    const RunProgress& progress = {});

[[nodiscard]] std::string format_board_table(const BoardReport& report);

}  // namespace stemvo
