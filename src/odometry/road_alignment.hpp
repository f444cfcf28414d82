// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

#include "odometry/road_picture.hpp"
#include "odometry/road_region.hpp"

namespace stemvo {

/// The parameters of an alignment are a plane m (m . X = 1 in the current camera) and a small
/// rotation w that corrects the given one, in this order.
using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// Warp of the current picture into the previous one by the homography R + t m^T of the road.
struct RoadWarp {
  Eigen::Matrix3d rotation;     ///< prev_from_cur
  Eigen::Vector3d translation;  ///< prev_from_cur
  Eigen::Vector3d plane;        ///< m, in units of the translation
};

/// Sums over the samples of one tile of the strip, of the residual r = prev(warp) - cur.
struct RoadTile {
  Matrix6d information = Matrix6d::Zero();  ///< sum of J^T J, Huber weights
  Vector6d gradient = Vector6d::Zero();     ///< sum of J^T r
  double cur_cur = 0.0;
  double prev_prev = 0.0;
  double cur_prev = 0.0;
  int num_samples = 0;

  /// Normalised cross-correlation, 0 where the tile is too small.
  [[nodiscard]] double correlation() const;
  /// Mean square of the residual.
  [[nodiscard]] double noise() const;
};
using RoadTiles = std::array<RoadTile, RoadRegion::kTiles>;

/// Sums over all samples that fall into the previous picture.
[[nodiscard]] RoadTiles align_road(const RoadPicture::Level& prev,
                                   const RoadPicture::Level& cur,
                                   const std::vector<RoadRegion::Sample>& samples,
                                   const RoadWarp& warp);
/// Correlation over all samples; the cheap part of align_road().
[[nodiscard]] double correlate_road(const RoadPicture::Level& prev,
                                    const RoadPicture::Level& cur,
                                    const std::vector<RoadRegion::Sample>& samples,
                                    const RoadWarp& warp);

}  // namespace stemvo
