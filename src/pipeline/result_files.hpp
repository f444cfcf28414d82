// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "dataset/frame_source.hpp"
#include "dataset/video_decoder.hpp"
#include "evaluation/trajectory.hpp"
#include "html/page.hpp"
#include "odometry/phased_odometry.hpp"
#include "pipeline/frame_pipeline.hpp"
#include "pipeline/run.hpp"
#include "report/run_page.hpp"
#include "stemvo/error.hpp"

namespace stemvo::pipeline {

/// The video of a run: each frame with its tracks, and beside it the path so far.
class DriveVideo {
 public:
  /// Writes RunRequest::video; without it nothing. Errors: those of dataset::encode_file.
  [[nodiscard]] static Expected<DriveVideo> create(const RunRequest& request,
                                                   const FrameSource& sequence);

  [[nodiscard]] bool is_on() const { return write_ != nullptr; }
  /// `image`: RGB, of the frames' size under a caption. `unit`: of the path's lengths.
  void add(const cv::Mat& image, const Trajectory& path, const std::string& unit) const;
  /// Behind the last frame. Error: the file is not whole.
  [[nodiscard]] Status finish() const;

 private:
  std::string file_;
  cv::Size size_;
  dataset::WriteFrame write_;
};

/// Files that a run writes into its folder, beside pictures/.
inline constexpr std::array kResultNames = {"config.yaml",
                                            "frames.csv",
                                            "metrics.json",
                                            "report.html",
                                            "trajectory_kitti.txt",
                                            "trajectory_tum.txt",
                                            "trajectory_map_kitti.txt",
                                            "trajectory_map_tum.txt",
                                            "trajectory.png",
                                            "map.ply"};

struct Run {
  const RunRequest& request;
  const FrameSource& sequence;
  PhasedOdometry& odometry;
  const BesideFrames& beside;
  const DriveVideo& video;
};

struct Drive {
  std::vector<FrameResult> frames;           ///< one per frame done
  Trajectory trajectory;                     ///< as result files hold it
  std::string csv;                           ///< frames.csv of them, without errors
  std::vector<html::CaptionedImage> images;  ///< of some, for report.html
  SmallFrames small_frames;                  ///< for report.html too
  std::vector<std::string> warnings;
  bool interrupted = false;
  Status written;  ///< of what grows while frames come: poses, frames.csv, images
};

/// Takes a run's frames through the odometry and keeps what each brings. Rows of frames.csv,
/// trajectory_kitti.txt and trajectory_tum.txt are on the disk with each frame: a run that is
/// killed loses none that was done.
[[nodiscard]] Drive run_drive(const Run& run, const RunProgress& progress);

/// " for 11 of 12 frames", and why not for the others.
[[nodiscard]] std::string count_matched(const RunRequest& request,
                                        std::size_t num_matched,
                                        std::size_t num_frames);

/// The first thing that went wrong while writing; the rest is written all the same.
void keep_first(Status& first, Status next);

/// The text of config.yaml: the effective configuration under comments that say which program,
/// frames and model made the results. `num_frames`: of a stream, those read; 0: not yet known.
[[nodiscard]] std::string config_text(const Run& run, std::size_t num_frames);

/// Writes all results but pictures; `report` becomes what metrics.json holds.
[[nodiscard]] Status write_results(const Run& run, const Drive& drive, MetricsReport& report);

}  // namespace stemvo::pipeline
