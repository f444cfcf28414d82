// SPDX-License-Identifier: MIT
#pragma once

#include "odometry/local_map.hpp"
#include "stemvo/geometry/camera.hpp"

namespace stemvo {

struct BundleAdjustmentOptions {
  int num_fixed_keyframes = 2;  ///< the oldest: they hold the gauge, scale included
  int max_iterations = 4;
  double loss_scale_px = 0.2;  ///< Cauchy scale on the reprojection error
  int min_observations = 3;    ///< of a landmark that takes part
};

struct BundleAdjustmentReport {
  bool is_usable = false;  ///< false: too little to do, or not solved; the map is unchanged
  int num_residuals = 0;
  int num_iterations = 0;
  double initial_cost = 0.0;
  double final_cost = 0.0;
};

/// Sliding-window bundle adjustment: poses of the window and its landmarks, robust reprojection
/// error, Schur complement over the landmarks. One thread: the same bytes on every run.
BundleAdjustmentReport refine_window(LocalMap& map,
                                     const Camera& camera,
                                     const BundleAdjustmentOptions& options);

}  // namespace stemvo
