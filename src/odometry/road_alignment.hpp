// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

#include "odometry/road_normal.hpp"
#include "odometry/road_picture.hpp"
#include "odometry/road_region.hpp"

namespace stemvo {

/// Sums over the samples of one tile of the strip, of the residual r = prev(warp) - cur.
struct RoadTile {
  /// Sum of a a^T with Huber weights, a = (J, r): J^T J and J^T r at once. Single precision is
  /// enough for the few hundred samples of a tile, and four times as fast.
  Eigen::Matrix<float, 8, 8> sums = Eigen::Matrix<float, 8, 8>::Zero();
  float cur_cur = 0.0F;
  float prev_prev = 0.0F;
  float cur_prev = 0.0F;
  int num_samples = 0;

  [[nodiscard]] RoadMatrix information() const { return sums.topLeftCorner<7, 7>().cast<double>(); }
  [[nodiscard]] RoadVector gradient() const { return sums.topRightCorner<7, 1>().cast<double>(); }
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
