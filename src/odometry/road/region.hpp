// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>
#include <vector>

#include <Eigen/Core>

#include "odometry/road/model.hpp"
#include "stemvo/camera.hpp"

namespace stemvo {

/// The strip of road in front of the car, as seen by the current camera: it starts at the image's
/// lower edge and follows the arc that the car drives on.
class RoadRegion {
 public:
  RoadRegion(const Rigid3& cur_from_prev, const RoadPrior& prior, const RoadOptions& options);

  struct Sample {
    int u = 0;
    int v = 0;
    int tile = 0;
  };
  /// Every `step_u`-th pixel of every `step_v`-th row of the strip that is not hidden; tiles are
  /// cells of the strip.
  [[nodiscard]] std::vector<Sample> samples(const RoadImage::Level& level,
                                            int step_u,
                                            int step_v) const;
  static constexpr int kTiles = 48;
  static constexpr int kTileColumns = 4;

  /// Position in the strip of a viewing ray (plane z = 1): x right of the middle and z ahead,
  /// metres; z <= 0: not on the ground.
  [[nodiscard]] Eigen::Vector2d on_ground(const Eigen::Vector2d& xy) const;
  [[nodiscard]] bool contains(const Eigen::Vector2d& on_ground) const {
    return on_ground.y() > 0.0 && on_ground.y() <= far_m_ &&
           std::abs(on_ground.x()) <= half_width_m_;
  }

 private:
  Eigen::Vector3d plane_;  ///< metres
  double heading_ = 0.0;
  double curvature_ = 0.0;  ///< 1 / m
  double half_width_m_;
  double far_m_;
};

}  // namespace stemvo
