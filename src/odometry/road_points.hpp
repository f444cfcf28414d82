// SPDX-License-Identifier: MIT
#pragma once

#include "odometry/road_picture.hpp"
#include "odometry/road_types.hpp"

namespace stemvo {

/// The road by points: faint corners in the strip of road are tracked into the previous picture,
/// warped as the predicted plane moves (so that fast and plain asphalt cannot lead the tracker
/// astray); those on the epipolar lines of the given motion are fitted by a plane: its depths, put
/// through the motion, must meet the tracks. The unknowns and priors are those of RoadDense.
class RoadPoints {
 public:
  explicit RoadPoints(const RoadOptions& options) : options_(options) {}

  /// `cur_from_prev`: in any unit of length; `prior` about that unit, its log_scale within some 10
  /// %.
  [[nodiscard]] RoadMeasurement measure(const RoadPicture& prev,
                                        const RoadPicture& cur,
                                        const Rigid3& cur_from_prev,
                                        const RoadPrior& prior) const;

 private:
  RoadOptions options_;
};

}  // namespace stemvo
