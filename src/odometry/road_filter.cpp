// SPDX-License-Identifier: MIT
#include "odometry/road_filter.hpp"

#include <algorithm>
#include <cmath>

namespace stemvo {

namespace {

constexpr double kHuber = 1.5;
constexpr double kDoubt = 3.0;  ///< standard deviations
constexpr int kMaxDoubts = 4;
/// A first measurement may be the wrong peak of a search over scales: others must confirm it.
constexpr double kFirstSigma = 0.1;

}  // namespace

void RoadFilter::predict() {
  sigma_ = std::min(std::hypot(sigma_, options_.drift_sigma), kUnknownSigma);
}

bool RoadFilter::update(double log_scale, double sigma) {
  if (!std::isfinite(log_scale) || !(sigma > 0.0) || !std::isfinite(sigma)) {
    return false;
  }
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
  } else {
    const int side = innovation > 0.0 ? 1 : -1;
    num_doubts_ = num_doubts_ * side > 0 ? num_doubts_ + side : side;
    if (std::abs(num_doubts_) >= kMaxDoubts) {
      num_doubts_ = 0;
      sigma_ = std::min(std::abs(innovation), kUnknownSigma);
      distance = std::abs(innovation) / std::hypot(measured, sigma_);
    }
  }
  // Beyond kHuber the measurement's variance grows with its distance.
  const double variance = measured * measured * std::max(1.0, distance / kHuber);
  const double gain = sigma_ * sigma_ / (sigma_ * sigma_ + variance);
  log_scale_ += gain * innovation;
  sigma_ *= std::sqrt(1.0 - gain);
  return distance < kDoubt;
}

void RoadFilter::restart() { *this = RoadFilter(options_); }

}  // namespace stemvo
