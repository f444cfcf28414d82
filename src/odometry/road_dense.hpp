// SPDX-License-Identifier: MIT
#pragma once

#include "odometry/road_picture.hpp"
#include "odometry/road_types.hpp"

namespace stemvo {

/// The road's plane by direct alignment: the strip of road in the current picture is warped into
/// the previous one by the homography of the plane, H = R + t m^T, and m is refined (Gauss-Newton
/// on the normalised pictures; small errors of the given rotation are estimated along with it).
class RoadDense {
 public:
  explicit RoadDense(const RoadOptions& options) : options_(options) {}

  /// `cur_from_prev`: in any unit of length; `prior` about that unit.
  [[nodiscard]] RoadMeasurement measure(const RoadPicture& prev,
                                        const RoadPicture& cur,
                                        const Rigid3& cur_from_prev,
                                        const RoadPrior& prior) const;

 private:
  RoadOptions options_;
};

}  // namespace stemvo
