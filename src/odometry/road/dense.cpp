// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "odometry/road/model.hpp"
#include "odometry/road/region.hpp"

namespace stemvo {
namespace {

constexpr double kMinTileCorrelation = 0.2;
constexpr int kMinTiles = 6;
constexpr double kMinCorrelation = 0.25;
constexpr double kMaxDenseSigma = 0.2;
constexpr std::size_t kMinSamples = 600;
/// Fewer than this where pixels are left out: take every pixel.
constexpr std::size_t kFewSamples = 2400;
constexpr int kMaxIterations = 5;     ///< per grid
constexpr double kCoarseBound = 5.0;  ///< times the last grid's bound of convergence
/// Floor of a tile's mean square residual, in normalised images: no tile is nearly certain.
constexpr double kNoiseFloor = 0.05;
constexpr double kSearchScaleSigma =
    0.05;  ///< prior knowledge of log_scale worse than this: search
constexpr double kSearchStep = 0.03;
constexpr double kMaxSearch = 1.8;
constexpr int kMinTileSamples = 20;
/// A plane so many times farther away does not move.
constexpr double kNoPlane = 1e-6;
/// Residuals beyond the images' own standard deviation count linearly.
constexpr float kHuberResidual = 1.0F;

double correlation_of(double cc, double pp, double cp) {
  return cc > 0.0 && pp > 0.0 ? cp / std::sqrt(cc * pp) : 0.0;
}

/// Sums over the samples of one tile of the strip, of the residual r = prev(warp) - cur.
struct Tile {
  /// Upper triangle of the sum of a a^T with Huber weights, a = (J, r): J^T J and J^T r. Single
  /// precision is enough for the few hundred samples of a tile, and four times as fast.
  Eigen::Matrix<float, 8, 8> sums = Eigen::Matrix<float, 8, 8>::Zero();
  float cur_cur = 0.0F;
  float prev_prev = 0.0F;
  float cur_prev = 0.0F;
  int num_samples = 0;

  RoadMatrix information() const {
    const RoadMatrix upper = sums.topLeftCorner<7, 7>().cast<double>();
    return upper.selfadjointView<Eigen::Upper>();
  }
  RoadVector gradient() const { return sums.topRightCorner<7, 1>().cast<double>(); }
  /// Normalised cross-correlation, 0 where the tile is too small.
  double correlation() const {
    return num_samples < kMinTileSamples ? 0.0 : correlation_of(cur_cur, prev_prev, cur_prev);
  }
  /// Mean square of the residual.
  double noise() const { return (cur_cur + prev_prev - 2.0 * cur_prev) / std::max(1, num_samples); }
};
using Tiles = std::array<Tile, RoadRegion::kTiles>;

/// A sample of the current image, seen through the warp.
struct Match {
  const RoadRegion::Sample& sample;
  const Eigen::Vector3f& ray;
  float inverse_flat;        ///< 1 / (plane . ray)
  const Eigen::Vector3f& p;  ///< in the previous camera
  float inverse_z;           ///< of p
  const Eigen::Array4f& prev;
  float cur;
};

/// Calls `visit` for each that falls into the previous image.
template <typename Visit>
void for_each_match(const RoadImage::Level& prev,
                    const RoadImage::Level& cur,
                    const std::vector<RoadRegion::Sample>& samples,
                    const RoadWarp& warp,
                    const Visit& visit) {
  const Camera& camera = cur.camera;
  const Eigen::Matrix3f rotation = warp.rotation().cast<float>();
  const Eigen::Vector3f translation = warp.translation.cast<float>();
  const Eigen::Vector3f plane = warp.plane.cast<float>();
  // RoadWarp::inverse_depth(), written out.
  const auto bend = static_cast<float>(4.0 * warp.drop * warp.plane.squaredNorm());
  const auto fx = static_cast<float>(camera.fx_px);
  const auto fy = static_cast<float>(camera.fy_px);
  const auto cx = static_cast<float>(camera.cx_px);
  const auto cy = static_cast<float>(camera.cy_px);
  const auto first_row = static_cast<float>(prev.first_row);
  const auto last_u = static_cast<float>(prev.values.cols - 2);
  const auto last_v = static_cast<float>(prev.values.rows - 2);
  const auto stride = static_cast<std::ptrdiff_t>(prev.values.step1());
  for (const RoadRegion::Sample& sample : samples) {
    const Eigen::Vector3f ray((static_cast<float>(sample.u) - cx) / fx,
                              (static_cast<float>(sample.v) - cy) / fy, 1.0F);
    const float flat = plane.dot(ray);
    const float inverse_flat = 1.0F / flat;
    const float root = 1.0F - bend * inverse_flat * inverse_flat;
    if (!(flat > 0.0F && root > static_cast<float>(kMinRoadRoot))) {
      continue;  // behind a crest
    }
    const Eigen::Vector3f p =
        rotation * ray + (0.5F * flat * (1.0F + std::sqrt(root))) * translation;
    const float inverse_z = 1.0F / p.z();
    const float u = fx * p.x() * inverse_z + cx;
    const float v = fy * p.y() * inverse_z + cy - first_row;
    if (!(p.z() > 1e-3F && u >= 1.0F && v >= 1.0F && u < last_u && v < last_v)) {
      continue;
    }
    const int iu = static_cast<int>(u);
    const int iv = static_cast<int>(v);
    const float a = u - static_cast<float>(iu);
    const float b = v - static_cast<float>(iv);
    const float* top = prev.values.ptr<float>(iv) + 4 * static_cast<std::ptrdiff_t>(iu);
    using Map = Eigen::Map<const Eigen::Array4f>;
    const Eigen::Array4f upper = Map(top) + a * (Map(top + 4) - Map(top));
    const Eigen::Array4f lower =
        Map(top + stride) + a * (Map(top + stride + 4) - Map(top + stride));
    const Eigen::Array4f value = upper + b * (lower - upper);
    if (value[3] > 0.0F) {
      continue;
    }
    visit({sample, ray, inverse_flat, p, inverse_z, value,
           cur.values.ptr<float>(sample.v -
                                 cur.first_row)[4 * static_cast<std::ptrdiff_t>(sample.u)]});
  }
}

Tiles align_road(const RoadImage::Level& prev,
                 const RoadImage::Level& cur,
                 const std::vector<RoadRegion::Sample>& samples,
                 const RoadWarp& warp) {
  Tiles tiles;
  const Eigen::Vector3f t = warp.translation.cast<float>();
  const auto bend_unit = static_cast<float>(warp.plane.squaredNorm());
  const auto fx = static_cast<float>(cur.camera.fx_px);
  const auto fy = static_cast<float>(cur.camera.fy_px);
  for_each_match(prev, cur, samples, warp, [&](const Match& match) {
    Tile& tile = tiles[static_cast<std::size_t>(match.sample.tile)];
    const float value = match.prev[0];
    tile.cur_cur += match.cur * match.cur;
    tile.prev_prev += value * value;
    tile.cur_prev += match.cur * value;
    ++tile.num_samples;
    // Gradient of the previous image along the point p: g = grad . dpi/dp.
    const Eigen::Vector3f& p = match.p;
    const float gx = match.prev[1] * fx * match.inverse_z;
    const float gy = match.prev[2] * fy * match.inverse_z;
    const Eigen::Vector3f g(gx, gy, -(gx * p.x() + gy * p.y()) * match.inverse_z);
    const float along = g.dot(t);
    Eigen::Matrix<float, 8, 1> a;
    a.head<3>() = along * match.ray;
    a[3] = -along * bend_unit * match.inverse_flat;
    a.segment<3>(4) = p.cross(g);  // of exp(w) p
    a[7] = value - match.cur;
    const float size = std::abs(a[7]);
    const Eigen::Matrix<float, 8, 1> weighted =
        (size <= kHuberResidual ? 1.0F : kHuberResidual / size) * a;
    tile.sums.topRows<4>().noalias() += a.head<4>() * weighted.transpose();
    tile.sums.bottomRightCorner<4, 4>().noalias() += a.tail<4>() * weighted.tail<4>().transpose();
  });
  return tiles;
}

double correlate_road(const RoadImage::Level& prev,
                      const RoadImage::Level& cur,
                      const std::vector<RoadRegion::Sample>& samples,
                      const RoadWarp& warp) {
  double cc = 0.0;
  double pp = 0.0;
  double cp = 0.0;
  std::size_t count = 0;
  for_each_match(prev, cur, samples, warp, [&](const Match& match) {
    cc += match.cur * match.cur;
    pp += match.prev[0] * match.prev[0];
    cp += match.cur * match.prev[0];
    ++count;
  });
  // A warp that leaves the image with all but a few samples has proven nothing.
  return 2 * count < samples.size() ? 0.0 : correlation_of(cc, pp, cp);
}

/// Joins the tiles, each weighted by correlation^2 / noise: plain or occluded ones hardly count.
/// The samples of a tile are not independent, which RoadNormal::inflate_variance accounts for.
/// Returns the number of tiles that count.
int join(const Tiles& tiles, RoadNormal& normal) {
  int num_tiles = 0;
  Eigen::Vector3d spread = Eigen::Vector3d::Zero();
  for (const Tile& tile : tiles) {
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
  normal.inflate_variance(spread);
  return num_tiles;
}

double total_correlation(const Tiles& tiles) {
  Tile sum;
  for (const Tile& tile : tiles) {
    sum.cur_cur += tile.cur_cur;
    sum.prev_prev += tile.prev_prev;
    sum.cur_prev += tile.cur_prev;
    sum.num_samples += tile.num_samples;
  }
  return sum.correlation();
}

/// Where the images are compared, the coarsest first.
struct Grid {
  RoadImage::Level prev;
  RoadImage::Level cur;
  std::vector<RoadRegion::Sample> samples;
};

/// The plane of the prior, at the scale with the best correlation.
Eigen::Vector3d search_plane(const RoadStep& step, const Grid& half, RoadWarp warp) {
  const RoadPrior& prior = step.prior;
  const int reach =
      static_cast<int>(std::min(kMaxSearch, 2.5 * prior.log_scale_sigma) / kSearchStep);
  const auto plane_at = [&](double log_scale) {
    return road_plane(log_scale, prior.slope_rad, prior.roll_rad, step.options.camera_height_m);
  };
  double best = -1.0;
  Eigen::Vector3d best_plane = plane_at(prior.log_scale);
  for (int i = -reach; i <= reach; ++i) {
    warp.plane = plane_at(prior.log_scale + kSearchStep * i);
    const double correlation = correlate_road(half.prev, half.cur, half.samples, warp);
    if (correlation > best) {
      best = correlation;
      best_plane = warp.plane;
    }
  }
  return best_plane;
}

/// Gauss-Newton on one grid after the other, the coarsest first.
RoadMeasurement refine(const RoadStep& step, const std::vector<Grid>& grids, RoadWarp warp) {
  RoadMatrix covariance = RoadMatrix::Zero();
  double correlation = 0.0;
  for (const Grid& grid : grids) {
    const bool is_last = &grid == &grids.back();
    const RoadWarp before = warp;
    for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
      const Tiles tiles = align_road(grid.prev, grid.cur, grid.samples, warp);
      RoadNormal normal;
      const bool has_tiles = join(tiles, normal) >= kMinTiles;
      normal.add_prior(warp, step.prior, step.options.rotation_sigma_rad);
      if (!has_tiles || !normal.step(warp)) {
        if (is_last) {
          return no_road(has_tiles ? "the alignment diverged" : "nothing moves like a road");
        }
        warp = before;  // too few samples, perhaps: the next grid has more
        break;
      }
      correlation = total_correlation(tiles);
      covariance = normal.covariance;
      if (normal.relative_change < (is_last ? 1.0 : kCoarseBound) * step.options.convergence) {
        break;
      }
    }
  }
  RoadMeasurement result = read_road(warp, covariance, step.options.camera_height_m);
  // Pixels that agree without the plane (far, blurred) prove none.
  RoadWarp no_plane = warp;
  no_plane.plane *= kNoPlane;
  const Grid& sparse = grids.front();
  result.correlation = correlation - std::max(0.0, correlate_road(sparse.prev, sparse.cur,
                                                                  sparse.samples, no_plane));
  result.is_valid = correlation > kMinCorrelation && result.sigma < kMaxDenseSigma;
  result.reason = result.is_valid ? "" : "the images of the road hardly agree";
  return result;
}

}  // namespace

RoadMeasurement measure_dense(const RoadStep& step) {
  if (step.prev.full.values.empty() || step.cur.full.values.empty()) {
    return no_road("the image ends above the road", false);
  }
  const RoadRegion region(step.cur_from_prev, step.prior, step.options);
  const auto grid = [&](const RoadImage::Level& prev, const RoadImage::Level& cur, int step_u,
                        int step_v) {
    return Grid{prev, cur, region.samples(cur, step_u, step_v)};
  };
  std::vector<Grid> grids;
  RoadWarp warp(step.cur_from_prev, step.prior, step.options.camera_height_m);
  // A scale that is known well starts within a pixel: half size is for the search.
  if (step.prior.log_scale_sigma > kSearchScaleSigma) {
    const RoadImage::Level half_prev = make_half_level(step.prev);
    const RoadImage::Level half_cur = make_half_level(step.cur);
    if (half_prev.values.empty() || half_cur.values.empty()) {
      return no_road("the image ends above the road", false);
    }
    const Grid sparse = grid(half_prev, half_cur, 2, 2);
    grids.push_back(sparse.samples.size() < kFewSamples ? grid(half_prev, half_cur, 1, 1) : sparse);
    warp.plane = search_plane(step, grids.back(), warp);
  }
  grids.push_back(grid(step.prev.full, step.cur.full, 4, 2));
  // Texture is stretched across the image: rows tell more than columns.
  grids.push_back(grid(step.prev.full, step.cur.full, 2, 1));
  if (grids.back().samples.size() < kFewSamples) {
    grids.back() = grid(step.prev.full, step.cur.full, 1, 1);
  }
  if (grids.back().samples.size() < kMinSamples) {
    return no_road("too little road in sight", false);
  }
  return refine(step, grids, warp);
}

}  // namespace stemvo
