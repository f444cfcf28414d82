// SPDX-License-Identifier: MIT
#pragma once

#include "odometry/road/image.hpp"
#include "odometry/road/model.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// Two frames, and what is believed before they are compared.
struct RoadStep {
  const RoadImage& prev;
  const RoadImage& cur;
  const Rigid3& cur_from_prev;  ///< in any unit of length
  const RoadPrior& prior;       ///< about that unit
  const RoadOptions& options;
};

/// The road's plane by direct alignment: the strip of road in the current image is warped into the
/// previous one by the homography of the plane, H = R + t m^T, and m is refined (Gauss-Newton on
/// the normalised images; small errors of the given rotation are estimated along with it).
[[nodiscard]] RoadMeasurement measure_dense(const RoadStep& step);

/// The road by points: faint corners in the strip of road are tracked into the previous image,
/// warped as the predicted plane moves (so that fast and plain asphalt cannot lead the tracker
/// astray); those on the epipolar lines of the given motion are fitted by a plane: its depths, put
/// through the motion, must meet the tracks. The prior's log_scale must be right within some 10 %.
[[nodiscard]] RoadMeasurement measure_points(const RoadStep& step);

}  // namespace stemvo
