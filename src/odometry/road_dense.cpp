// SPDX-License-Identifier: MIT
#include "odometry/road_dense.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "odometry/road_alignment.hpp"
#include "odometry/road_region.hpp"

namespace stemvo {

namespace {

constexpr double kMinTileCorrelation = 0.2;
constexpr int kMinTiles = 6;
constexpr double kMinCorrelation = 0.25;
constexpr double kMaxSigma = 0.2;
constexpr std::size_t kMinSamples = 600;
/// Fewer than this at every second pixel: take every pixel.
constexpr std::size_t kFewSamples = 2400;
constexpr int kMaxIterations = 5;  ///< per level
/// Of a tile's mean square residual, in normalised pictures.
constexpr double kNoiseFloor = 0.05;
constexpr double kSearchSigma = 0.05;  ///< prior knowledge of log_scale worse than this: search
constexpr double kSearchStep = 0.03;
constexpr double kMaxSearch = 1.8;

/// Joins the tiles. A tile counts by how well it correlates: plain or occluded ones do not. The
/// samples of a tile are not independent (the pictures are smooth, and a bump or a kerb moves all
/// of them): the spread of the tiles' gradients tells how much less they are worth together.
/// Returns the number of tiles that count.
int join(const RoadTiles& tiles, RoadNormal& normal) {
  int num_tiles = 0;
  Eigen::Vector3d spread = Eigen::Vector3d::Zero();
  for (const RoadTile& tile : tiles) {
    const double correlation = tile.correlation();
    if (!(correlation >= kMinTileCorrelation)) {
      continue;
    }
    ++num_tiles;
    const double weight = correlation * correlation / (tile.noise() + kNoiseFloor);
    const RoadVector gradient = weight * tile.gradient();
    normal.information += weight * tile.information();
    normal.gradient += gradient;
    spread += gradient.head<3>().cwiseAbs2();
  }
  normal.discount(spread);
  return num_tiles;
}

/// Best correlation over a range of scales, at the coarse level.
double search_log_scale(const RoadPicture::Level& prev,
                        const RoadPicture::Level& cur,
                        const std::vector<RoadRegion::Sample>& samples,
                        const RoadPrior& prior,
                        double camera_height_m,
                        RoadWarp warp) {
  const int reach =
      static_cast<int>(std::min(kMaxSearch, 2.5 * prior.log_scale_sigma) / kSearchStep);
  double best = -1.0;
  double best_log_scale = prior.log_scale;
  for (int i = -reach; i <= reach; ++i) {
    const double log_scale = prior.log_scale + kSearchStep * i;
    warp.plane = road_plane(log_scale, prior.slope_rad, prior.roll_rad, camera_height_m);
    const double correlation = correlate_road(prev, cur, samples, warp);
    if (correlation > best) {
      best = correlation;
      best_log_scale = log_scale;
    }
  }
  return best_log_scale;
}

bool has_levels(const RoadPicture& picture) {
  return picture.levels.size() == 2 && !picture.levels[0].values.empty() &&
         !picture.levels[1].values.empty();
}

double total_correlation(const RoadTiles& tiles) {
  RoadTile sum;
  for (const RoadTile& tile : tiles) {
    sum.cur_cur += tile.cur_cur;
    sum.prev_prev += tile.prev_prev;
    sum.cur_prev += tile.cur_prev;
    sum.num_samples += tile.num_samples;
  }
  return sum.correlation();
}

using LevelSamples = std::array<std::vector<RoadRegion::Sample>, 2>;

/// Gauss-Newton at half size where there are samples, then at full size.
RoadMeasurement refine(const RoadPicture& prev,
                       const RoadPicture& cur,
                       const LevelSamples& samples,
                       const RoadPrior& prior,
                       const RoadOptions& options,
                       RoadWarp warp) {
  RoadMatrix covariance = RoadMatrix::Zero();
  double quality = 0.0;
  int num_tiles = 0;
  for (const std::size_t level : {std::size_t{1}, std::size_t{0}}) {
    for (int iteration = 0; !samples[level].empty() && iteration < kMaxIterations; ++iteration) {
      const RoadTiles tiles =
          align_road(prev.levels[level], cur.levels[level], samples[level], warp);
      RoadNormal normal;
      num_tiles = join(tiles, normal);
      if (num_tiles < kMinTiles) {
        return no_road("nothing moves like a road");
      }
      normal.add_prior(warp, prior, options.rotation_sigma_rad);
      if (!normal.step(warp)) {
        return no_road("the alignment diverged");
      }
      quality = total_correlation(tiles);
      covariance = normal.covariance;
      if (normal.relative_change < (level == 1 ? 5.0 : 1.0) * options.convergence) {
        break;
      }
    }
  }
  RoadMeasurement result = read_road(warp, covariance, options.camera_height_m);
  result.quality = quality;
  result.num_points = num_tiles;
  result.is_valid = result.quality > kMinCorrelation && result.sigma < kMaxSigma;
  result.reason = result.is_valid ? "" : "the pictures of the road hardly agree";
  return result;
}

}  // namespace

RoadMeasurement RoadDense::measure(const RoadPicture& prev,
                                   const RoadPicture& cur,
                                   const Rigid3& cur_from_prev,
                                   const RoadPrior& prior) const {
  if (!is_motion(cur_from_prev)) {
    return no_road("no motion");
  }
  if (!has_levels(prev) || !has_levels(cur)) {
    return no_road("the picture ends above the road");
  }
  const RoadRegion region(cur_from_prev, prior, options_);
  // A scale that is known well starts within a pixel: half size is for the search.
  const bool is_searched = prior.log_scale_sigma > kSearchSigma;
  LevelSamples samples;
  for (std::size_t k = 0; k < (is_searched ? 2 : 1); ++k) {
    const RoadPicture::Level& level = cur.levels[k];
    samples[k] = region.samples(level.camera, level.first_row, 2);
    if (samples[k].size() < kFewSamples) {
      samples[k] = region.samples(level.camera, level.first_row, 1);
    }
  }
  if (samples[0].size() < kMinSamples) {
    return no_road("too little road in sight");
  }
  RoadWarp warp(cur_from_prev, prior, options_.camera_height_m);
  if (is_searched) {
    const double log_scale = search_log_scale(prev.levels[1], cur.levels[1], samples[1], prior,
                                              options_.camera_height_m, warp);
    warp.plane = road_plane(log_scale, prior.slope_rad, prior.roll_rad, options_.camera_height_m);
  }
  return refine(prev, cur, samples, prior, options_, warp);
}

}  // namespace stemvo
