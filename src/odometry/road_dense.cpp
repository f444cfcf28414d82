// SPDX-License-Identifier: MIT
#include "odometry/road_dense.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Cholesky>

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
constexpr std::size_t kFewSamples = 4000;
constexpr double kSearchSigma = 0.05;  ///< prior knowledge of log_scale worse than this: search
constexpr double kSearchStep = 0.03;
constexpr double kMaxSearch = 1.8;

/// Normal equations of one alignment, with the priors of RoadPrior and of the rotation in it.
struct Normal {
  Matrix6d information = Matrix6d::Zero();
  Vector6d gradient = Vector6d::Zero();
  int num_tiles = 0;

  void add(const Vector6d& jacobian, double residual, double sigma) {
    information += jacobian * jacobian.transpose() / (sigma * sigma);
    gradient += jacobian * residual / (sigma * sigma);
  }
};

/// Joins the tiles. A tile counts by how well it correlates: plain or occluded ones do not. The
/// samples of a tile are not independent (the pictures are smooth, and a bump or a kerb moves all
/// of them): the spread of the tiles' gradients tells how much less they are worth together.
Normal join(const RoadTiles& tiles) {
  Normal normal;
  Matrix6d spread = Matrix6d::Zero();
  for (const RoadTile& tile : tiles) {
    const double correlation = tile.correlation();
    if (!(correlation >= kMinTileCorrelation)) {
      continue;
    }
    ++normal.num_tiles;
    const double weight = correlation * correlation / (tile.noise() + 0.05);
    normal.information += weight * tile.information;
    normal.gradient += weight * tile.gradient;
    spread += weight * weight * tile.gradient * tile.gradient.transpose();
  }
  double excess = 0.0;
  for (int i = 0; i < 3; ++i) {
    excess += spread(i, i) / (3.0 * std::max(normal.information(i, i), 1e-12));
  }
  normal.information /= std::max(1.0, excess);
  normal.gradient /= std::max(1.0, excess);
  return normal;
}

void add_priors(const RoadWarp& warp,
                const Eigen::Vector3d& rotation,
                const RoadPrior& prior,
                double rotation_sigma_rad,
                Normal& normal) {
  const Eigen::Vector3d& m = warp.plane;
  Vector6d jacobian = Vector6d::Zero();  // slope = -m_z / m_y
  jacobian[1] = prior.slope_rad / m.y();
  jacobian[2] = 1.0 / m.y();
  normal.add(jacobian, m.z() / m.y() + prior.slope_rad, prior.slope_sigma);
  jacobian.setZero();  // roll = -m_x / m_y
  jacobian[0] = 1.0 / m.y();
  jacobian[1] = prior.roll_rad / m.y();
  normal.add(jacobian, m.x() / m.y() + prior.roll_rad, prior.roll_sigma);
  for (int i = 0; i < 3; ++i) {
    normal.add(Vector6d::Unit(3 + i), rotation[i], rotation_sigma_rad);
  }
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

RoadMeasurement refused(std::string_view reason) {
  RoadMeasurement result;
  result.reason = reason;
  return result;
}

}  // namespace

RoadMeasurement RoadDense::measure(const RoadPicture& prev,
                                   const RoadPicture& cur,
                                   const Rigid3& cur_from_prev,
                                   const RoadPrior& prior) const {
  if (!has_levels(prev) || !has_levels(cur)) {
    return refused("the picture ends above the road");
  }
  const double length = cur_from_prev.translation.norm();
  if (!std::isfinite(length) || !(length > 0.0) || !std::isfinite(cur_from_prev.rotation.norm())) {
    return refused("no motion");
  }
  const RoadRegion region(cur_from_prev, prior, options_);
  std::array<std::vector<RoadRegion::Sample>, 2> samples;
  for (std::size_t k = 0; k < 2; ++k) {
    const RoadPicture::Level& level = cur.levels[k];
    samples[k] = region.samples(level.camera, level.first_row, 2);
    if (samples[k].size() < kFewSamples) {
      samples[k] = region.samples(level.camera, level.first_row, 1);
    }
  }
  if (samples[0].size() < kMinSamples) {
    return refused("too little road in sight");
  }
  const Rigid3 prev_from_cur = cur_from_prev.inverse();
  RoadWarp warp{prev_from_cur.rotation_matrix(), prev_from_cur.translation, {}};
  double log_scale = prior.log_scale;
  if (prior.log_scale_sigma > kSearchSigma) {
    log_scale = search_log_scale(prev.levels[1], cur.levels[1], samples[1], prior,
                                 options_.camera_height_m, warp);
  }
  warp.plane = road_plane(log_scale, prior.slope_rad, prior.roll_rad, options_.camera_height_m);
  return refine(prev, cur, samples, prior, warp);
}

RoadMeasurement RoadDense::refine(const RoadPicture& prev,
                                  const RoadPicture& cur,
                                  const std::array<std::vector<RoadRegion::Sample>, 2>& samples,
                                  const RoadPrior& prior,
                                  RoadWarp warp) const {
  RoadMeasurement result;
  const Eigen::Matrix3d given_rotation = warp.rotation;
  Eigen::Vector3d rotation = Eigen::Vector3d::Zero();
  Matrix6d covariance;
  std::size_t level = 1;
  for (int iteration = 0, last = 4; iteration < last; ++iteration) {
    const RoadTiles tiles = align_road(prev.levels[level], cur.levels[level], samples[level], warp);
    Normal normal = join(tiles);
    if (normal.num_tiles < kMinTiles) {
      return refused("nothing moves like a road");
    }
    add_priors(warp, rotation, prior, options_.rotation_sigma_rad, normal);
    const Eigen::LDLT<Matrix6d> solver(normal.information);
    const Vector6d step = solver.solve(-normal.gradient);
    covariance = solver.solve(Matrix6d::Identity());
    warp.plane += step.head<3>();
    rotation += step.tail<3>();
    if (!step.allFinite() || !(warp.plane.y() > 0.0)) {
      return refused("the alignment diverged");
    }
    warp.rotation = so3_exp(rotation).toRotationMatrix() * given_rotation;
    result.quality = total_correlation(tiles);
    result.num_points = normal.num_tiles;
    const bool is_converged = step.head<3>().norm() < options_.convergence * warp.plane.norm();
    if (level == 1 && (is_converged || iteration + 1 == last)) {
      level = 0;
      last = iteration + 1 + 5;
    } else if (is_converged) {
      break;
    }
  }
  const Eigen::Vector3d& m = warp.plane;
  const Eigen::Vector3d gain = m / m.squaredNorm();  // of log |m|
  result.log_scale = std::log(options_.camera_height_m * m.norm());
  result.sigma = std::sqrt(gain.dot(covariance.topLeftCorner<3, 3>() * gain));
  result.slope_rad = -m.z() / m.y();
  result.roll_rad = -m.x() / m.y();
  result.is_valid = result.quality > kMinCorrelation && result.sigma < kMaxSigma;
  result.reason = result.is_valid ? "" : "the pictures of the road hardly agree";
  return result;
}

}  // namespace stemvo
