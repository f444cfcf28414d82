// SPDX-License-Identifier: MIT
#include "odometry/road/filter.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include <Eigen/LU>

namespace stemvo {

namespace {

constexpr double kHuber = 1.5;
constexpr double kDoubt = 3.0;  ///< standard deviations
/// In a row, as many as were believed before, within these: off the road, in a tight turn, dozens
/// of frames tell the same wrong scale, and the map does not drift as fast.
constexpr int kMinDoubts = 4;
constexpr int kMaxDoubts = 32;
/// A first measurement may be the wrong peak of a search over scales: others must confirm it.
constexpr double kFirstSigma = 0.1;
constexpr std::size_t kMaxPositions = 64;  ///< of a path

}  // namespace

void RoadFilter::predict() {
  sigma_ = std::min(std::hypot(sigma_, options_.drift_sigma), kUnknownSigma);
}

bool RoadFilter::update(double log_scale, double sigma) {
  const double measured = std::hypot(sigma, options_.flatness_sigma);
  if (!is_initialized_) {
    is_initialized_ = true;
    log_scale_ = log_scale;
    sigma_ = std::max(measured, kFirstSigma);
    return true;
  }
  if (!options_.join_frames) {
    log_scale_ = log_scale;
    sigma_ = measured;
    return true;
  }
  const double innovation = log_scale - log_scale_;
  double distance = std::abs(innovation) / std::hypot(measured, sigma_);
  if (distance < kDoubt) {
    num_doubts_ = 0;
    num_believed_ = std::min(num_believed_, kMaxDoubts - 1) + 1;
  } else {
    const int side = innovation > 0.0 ? 1 : -1;
    num_doubts_ = (num_doubts_ > 0) == (side > 0)
                      ? std::clamp(num_doubts_, -kMaxDoubts, kMaxDoubts) + side
                      : side;
    if (std::abs(num_doubts_) >= std::max(num_believed_, kMinDoubts)) {
      num_doubts_ = 0;
      num_believed_ = 0;
      sigma_ = std::min(std::abs(innovation), kUnknownSigma);
      distance = std::abs(innovation) / std::hypot(measured, sigma_);
    }
  }
  // Huber's weight of a residual d is kHuber / d, so the variance grows by d / kHuber; beyond
  // kDoubt it grows by d / kDoubt once more: an outlier then moves the state less the farther it
  // is.
  const double growth = std::max(1.0, distance / kHuber) * std::max(1.0, distance / kDoubt);
  const double variance = measured * measured * growth;
  const double gain = sigma_ * sigma_ / (sigma_ * sigma_ + variance);
  log_scale_ += gain * innovation;
  sigma_ *= std::sqrt(1.0 - gain);
  return distance < kDoubt;
}

void RoadFilter::restart() { *this = RoadFilter(options_); }

void RoadPath::move(const Rigid3& cur_from_prev) {
  if (!(cur_from_prev.translation.norm() > 0.0)) {
    return;  // standing
  }
  for (Eigen::Vector3d& position : positions_) {
    position = cur_from_prev * position;
  }
  positions_.push_front(cur_from_prev.translation);
  if (positions_.size() > kMaxPositions) {
    positions_.pop_back();
  }
}

void RoadPath::rescale(double factor) {
  for (Eigen::Vector3d& position : positions_) {
    position *= factor;
  }
}

void RoadPath::predict(double metres_per_unit, RoadPrior& prior) const {
  const double weight = 1.0 / (options_.heave_sigma_m * options_.heave_sigma_m);
  Eigen::Matrix3d information =
      Eigen::Vector3d(weight, 1.0 / (options_.free_slope_sigma_rad * options_.free_slope_sigma_rad),
                      1.0 / (options_.bend_sigma_per_m * options_.bend_sigma_per_m))
          .asDiagonal();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& position : positions_) {
    const double z = position.z() * metres_per_unit;
    if (!(z > -options_.path_m && z < 0.0)) {
      break;  // farther back, or turned round: the road may have bent otherwise
    }
    const Eigen::Vector3d row(1.0, z, z * z);
    information += weight * row * row.transpose();
    right += weight * position.y() * metres_per_unit * row;
  }
  const Eigen::Matrix3d covariance = information.inverse();
  const Eigen::Vector3d profile = covariance * right;
  const Eigen::DiagonalMatrix<double, 2> units(1.0, options_.camera_height_m);
  const Eigen::Matrix2d of_slope_and_drop = units * covariance.bottomRightCorner<2, 2>() * units;
  prior.slope_rad = profile[1];
  prior.drop = options_.camera_height_m * profile[2];
  prior.profile_information = of_slope_and_drop.inverse();
}

}  // namespace stemvo
