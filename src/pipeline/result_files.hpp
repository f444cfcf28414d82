// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "dataset/frame_source.hpp"
#include "evaluation/trajectory.hpp"
#include "html/page.hpp"
#include "odometry/phased_odometry.hpp"
#include "pipeline/beside_frames.hpp"
#include "pipeline/drive_video.hpp"
#include "pipeline/run.hpp"
#include "report/run_page.hpp"
#include "stemvo/error.hpp"

namespace stemvo::pipeline {

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
                                            "map.ply",
                                            ".stemvo_video"};  // names the video in the folder

/// A run refers to its request, its frames and its odometry.
struct Run {
  const RunRequest& request;
  const FrameSource& sequence;
  PhasedOdometry& odometry;
  const BesideFrames& beside;
  const DriveVideo& video;
};

/// The loop over the frames leaves this behind.
struct Drive {
  std::vector<FrameResult> frames;           ///< one per frame done
  Trajectory trajectory;                     ///< as result files hold it
  std::string csv;                           ///< frames.csv of them, without errors
  std::vector<html::CaptionedImage> images;  ///< of some, for report.html
  SmallFrames small_frames;                  ///< for report.html too
  std::vector<std::string> warnings;
  bool interrupted = false;
  Status written;  ///< of frames.csv and the images
};

/// Takes a run's frames through the odometry and keeps what each brings. Rows of frames.csv,
/// trajectory_kitti.txt and trajectory_tum.txt grow on the disk meanwhile: a run that is killed
/// loses less than two seconds.
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

/// Everything that is written at the end; `report` becomes what metrics.json holds:
/// trajectory_kitti.txt, trajectory_tum.txt, config.yaml (`stemvo run --config` takes it as it is),
/// trajectory.png, metrics.json, report.html; mode map: map.ply and, with loops,
/// trajectory_map_kitti.txt, trajectory_map_tum.txt and the map to be saved.
[[nodiscard]] Status write_results(const Run& run, const Drive& drive, MetricsReport& report);

}  // namespace stemvo::pipeline
