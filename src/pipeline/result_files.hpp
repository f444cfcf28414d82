// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "dataset/frame_source.hpp"
#include "evaluation/trajectory.hpp"
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
  FrameResult last;  ///< of the last frame done
  std::vector<std::string> warnings;
  bool interrupted = false;
  Status written;  ///< of frames.csv and the images
};

/// The trajectory of the first frames of a run as its files hold it: of scale.source=ground_truth
/// with the ground truth's step lengths.
[[nodiscard]] Trajectory as_written(const RunRequest& request,
                                    const FrameSource& sequence,
                                    Trajectory trajectory);

/// Everything that is written at the end but metrics.json, for which it makes `report`:
/// trajectory_kitti.txt, trajectory_tum.txt, trajectory_refined_kitti.txt (without a refined
/// trajectory, what an earlier run left there is removed), config.yaml (the effective configuration
/// under comments that say which program, frames and model made the results; `stemvo run --config`
/// takes it as it is), map.ply where it is asked for, trajectory.png and .svg.
[[nodiscard]] Status write_results(const RunRequest& request,
                                   const FrameSource& sequence,
                                   const PhasedOdometry& odometry,
                                   const Drive& drive,
                                   MetricsReport& report);

}  // namespace stemvo::pipeline
