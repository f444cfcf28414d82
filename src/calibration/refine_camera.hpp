// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <vector>

#include "calibration/joint_adjustment.hpp"
#include "calibration/segment.hpp"
#include "stemvo/geometry/camera.hpp"

namespace stemvo::calibration {

struct RefinementOptions {
  int num_rounds = 3;          ///< of solving and rejecting with a free camera
  double outlier_bound = 4.0;  ///< reprojection error, in robust deviations per coordinate
  double loss_scale = 3.0;     ///< of the Cauchy loss, likewise
  double min_loss_px = 0.05;
  int min_observations = 3;  ///< of a landmark
  /// Relative for f, px for cx and cy: more is not determined.
  std::array<double, kNumIntrinsics> max_deviation = {0.005, 2.0, 2.0};
};

struct RefinedCamera {
  SharedVector shared = SharedVector::Zero();
  SharedVector deviation = SharedVector::Zero();  ///< when last free
  SharedMask is_determined = kNothingFree;        ///< k1, k2: whether they were free in the end
  double given_error_px = 0.0;                    ///< root mean square per coordinate
  double refined_error_px = 0.0;
  bool stopped = false;
};

/// The camera under which the segments fit together best. Numbers that the segments do not
/// determine go back to what was given, the worst first, and the rest is solved again. The
/// segments are left at the solution without their outliers. `on_step`: steps done, in all (an
/// upper bound); false stops.
[[nodiscard]] RefinedCamera refine_camera(
    std::vector<Segment>& segments,
    const Camera& given,
    const RefinementOptions& options,
    const std::function<bool(std::size_t, std::size_t)>& on_step);

}  // namespace stemvo::calibration
