// SPDX-License-Identifier: MIT
#pragma once

#include <deque>

#include <Eigen/Core>

#include "odometry/road/model.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// The way that the camera came: it lies above the road at the camera's height, but for the car's
/// bouncing, and tells the slope and the bend of the road under the car, whatever the camera's
/// pitch. Without it a crest ahead looks like a larger step (the plane through the road ahead
/// passes closer under the camera than the road does): 1 mrad of bend between car and strip is 0.3
/// % of scale.
class RoadPath {
 public:
  explicit RoadPath(const RoadOptions& options) : options_(options) {}

  /// `cur_from_prev`: in units of the map.
  void move(const Rigid3& cur_from_prev);
  void rescale(double factor);
  void restart() { positions_.clear(); }

  /// Fills slope, drop and their information: y = y0 + slope z + drop / height z^2 through the
  /// positions, y0: the current vertical bounce.
  void predict(double metres_per_unit, RoadPrior& prior) const;

 private:
  RoadOptions options_;
  std::deque<Eigen::Vector3d> positions_;  ///< in the current camera, map units; newest first
};

}  // namespace stemvo
