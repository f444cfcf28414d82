// SPDX-License-Identifier: MIT
#pragma once

#include <chrono>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "dataset/frame_source.hpp"
#include "report/metrics_json.hpp"
#include "stemvo/error.hpp"
#include "stemvo/frame_result.hpp"

namespace stemvo {

/// The camera is that of `config`, the height as dataset::with_camera_height says.
struct RunRequest : FrameSourceRequest {
  std::filesystem::path out_dir;  ///< empty: a new results/NAME
  Config config;
  std::optional<std::filesystem::path> speeds;  ///< of the camera, as dataset::read_speeds
  std::optional<std::filesystem::path> gyro;    ///< as dataset::read_gyro
  int num_threads = 0;                          ///< 0: all cores
  int image_every = 0;                          ///< 0: no per-frame images
  /// An earlier run's map, whose places are recognized; needs odometry.mode map with loops.
  std::optional<std::filesystem::path> map;
  std::optional<std::filesystem::path> saved_map;  ///< is written in the end; needs the same
  std::optional<std::filesystem::path> video;      ///< as DriveVideo draws it
  bool adjust_map = false;     ///< keyframes, landmarks and camera together, in the end
  bool measure_times = false;  ///< RunSummary::report.timing
  std::string command;         ///< that repeats the run, for report.html; may be empty
  /// Called before work starts, and of a stream's ground truth after it: what the input was taken
  /// for, a line each.
  std::function<void(const std::string&)> note;
  /// Called after each frame, maybe from another thread: its number in the recording, what came of
  /// it, and its pose as result files hold it.
  std::function<void(std::size_t, const FrameResult&, const Rigid3&)> on_frame;
  /// Where `fps` counts from; the program sets the start of the process.
  std::chrono::steady_clock::time_point started = std::chrono::steady_clock::now();
};

struct RunSummary {
  MetricsReport report;               ///< what metrics.json holds
  std::filesystem::path out_dir;      ///< where all of it is
  std::vector<std::string> warnings;  ///< unreadable frames and the like, one line each
  bool interrupted = false;           ///< stopped early, no live camera; results hold what was done
  Status written;                     ///< the first result that could not be written, if any
};

/// Called after each frame: frames done, frames in all (0: not known); false stops (results are
/// written).
using RunProgress = std::function<bool(std::size_t, std::size_t)>;

/// Opens the sequence, runs the odometry over it and writes every result file into out_dir
/// (kResultNames, pictures/%06d.png); an earlier run's are removed when this one starts. A wrong
/// request is an error before work starts; a frame that cannot be read is a warning and gets a
/// pose; when a result cannot be written the others still are. One run with measure_times at a time
/// in a process. OpenCV is told, for the whole process, how many threads it may use. `progress` may
/// be called from another thread.
[[nodiscard]] Expected<RunSummary> run_sequence(const RunRequest& request,
                                                const RunProgress& progress = {});

struct ChannelImagesRequest : FrameSourceRequest {
  std::filesystem::path out_dir;
  Config config;                             ///< `input` and `stem` are used
  std::optional<FrameRangeRequest> filters;  ///< half open, as frames; else all of the layer
};

struct ChannelImagesReport {
  std::size_t num_written = 0;
  std::vector<std::string> warnings;  ///< of the recording
};

/// The paper's Figure 1. For each frame: %06d_input.png, %06d_filter_%03d.png (8 bit, as the front
/// end sees it) and %06d_sheet.png with all of them.
/// Errors: those of the sequence and the model, filters outside the layer, an unreadable frame,
/// out_dir that cannot be written.
[[nodiscard]] Expected<ChannelImagesReport> write_channel_images(
    const ChannelImagesRequest& request, const RunProgress& progress = {});

}  // namespace stemvo
