// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "dataset/frame_source.hpp"
#include "evaluation/trajectory.hpp"
#include "html/page.hpp"
#include "odometry/phased_odometry.hpp"
#include "pipeline/run.hpp"
#include "stemvo/error.hpp"

namespace stemvo::pipeline {

/// The first thing that went wrong while writing; the rest is written all the same.
void keep_first(Status& first, Status next);

/// What the loop over the frames leaves behind.
struct Drive {
  Trajectory trajectory;  ///< one pose per frame done
  std::size_t num_measured = 0;
  std::size_t num_road_measured = 0;
  std::vector<FrameResult> frames;           ///< of each of them
  std::vector<html::CaptionedImage> images;  ///< of some, for report.html
  std::vector<std::string> warnings;
  bool interrupted = false;
  double elapsed_before_s = 0.0;  ///< in the runs that this one goes on from
  Status written;                 ///< of frames.csv and the images
};

/// The trajectory of the first frames of a run as its files hold it: of scale.source=ground_truth
/// with the ground truth's step lengths.
[[nodiscard]] Trajectory as_written(const RunRequest& request,
                                    const FrameSource& sequence,
                                    Trajectory trajectory);

/// What config.yaml holds: the effective configuration under comments that say which program,
/// frames and model made the results. `num_frames`: of a stream, those read.
[[nodiscard]] std::string config_text(const RunRequest& request,
                                      const FrameSource& sequence,
                                      const PhasedOdometry& odometry,
                                      std::size_t num_frames);

/// Everything that is written at the end but metrics.json, for which it makes `report`:
/// trajectory_kitti.txt, trajectory_tum.txt, trajectory_refined_kitti.txt (without a refined
/// trajectory, what an earlier run left there is removed), config.yaml (`stemvo run --config` takes
/// it as it is), map.ply where it is asked for, trajectory.png.
[[nodiscard]] Status write_results(const RunRequest& request,
                                   const FrameSource& sequence,
                                   const PhasedOdometry& odometry,
                                   const Drive& drive,
                                   MetricsReport& report);

/// report.html, of the report with everything in it.
[[nodiscard]] Status write_report_page(const RunRequest& request,
                                       const FrameSource& sequence,
                                       const PhasedOdometry& odometry,
                                       const Drive& drive,
                                       const MetricsReport& report);

}  // namespace stemvo::pipeline
