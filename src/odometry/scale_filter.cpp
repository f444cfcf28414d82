// SPDX-License-Identifier: MIT
#include "odometry/scale_filter.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

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
constexpr double kTrendKept = 0.99;  ///< of a trend that nothing confirms, per frame

}  // namespace

void ScaleFilter::predict() {
  sigma_ = std::min(std::hypot(sigma_, drift_sigma_), kUnknownSigma);
  log_scale_ += trend_;
  trend_ *= kTrendKept;
  ++frames_since_way_;
}

bool ScaleFilter::update(double log_scale, double sigma, ScaleWitness witness) {
  if (!is_initialized_) {
    is_initialized_ = true;
    log_scale_ = log_scale;
    sigma_ = std::max(sigma, kFirstSigma);
    return true;
  }
  if (!joins_frames_) {
    log_scale_ = log_scale;
    sigma_ = sigma;
    return true;
  }
  const double innovation = log_scale - log_scale_;
  const double distance = judge(innovation, sigma, witness);
  // Huber's weight of a residual d is kHuber / d, so the variance grows by d / kHuber; beyond
  // kDoubt it grows by d / kDoubt once more: an outlier then moves the state less the farther it
  // is.
  const double growth = std::max(1.0, distance / kHuber) * std::max(1.0, distance / kDoubt);
  const double variance = sigma * sigma * growth;
  const double gain = sigma_ * sigma_ / (sigma_ * sigma_ + variance);
  if (witness == ScaleWitness::kRoad) {
    frames_since_way_ = 0;
    trend_ = 0.0;
  } else {
    // Critical damping; not from a state that is yet to be found.
    const bool is_trend = sigma_ < sigma && frames_since_way_ > 0;
    trend_ += is_trend ? 0.25 * gain * gain * innovation / frames_since_way_ : 0.0;
    frames_since_way_ = 0;
  }
  log_scale_ += gain * innovation;
  sigma_ *= std::sqrt(1.0 - gain);
  return distance < kDoubt;
}

double ScaleFilter::judge(double innovation, double sigma, ScaleWitness witness) {
  auto& [num_doubts, num_believed] = records_[static_cast<std::size_t>(witness)];
  const double distance = std::abs(innovation) / std::hypot(sigma, sigma_);
  if (distance < kDoubt) {
    num_doubts = 0;
    num_believed = std::min(num_believed, kMaxDoubts - 1) + 1;
    if (witness == ScaleWitness::kWay) {
      records_[static_cast<std::size_t>(ScaleWitness::kRoad)].num_doubts = 0;
    }
    return distance;
  }
  const int side = innovation > 0.0 ? 1 : -1;
  num_doubts = (num_doubts > 0) == (side > 0)
                   ? std::clamp(num_doubts, -kMaxDoubts, kMaxDoubts) + side
                   : side;
  if (std::abs(num_doubts) < std::max(num_believed, kMinDoubts)) {
    return distance;
  }
  num_doubts = 0;
  num_believed = 0;
  trend_ = 0.0;
  sigma_ = std::min(std::abs(innovation), kUnknownSigma);
  return std::abs(innovation) / std::hypot(sigma, sigma_);
}

std::optional<double> ScaleFilter::innovation(double log_scale, double sigma) const {
  if (!is_initialized_) {
    return std::nullopt;
  }
  return (log_scale - log_scale_) / std::hypot(sigma, sigma_);
}

void ScaleFilter::restart() { *this = ScaleFilter(drift_sigma_, joins_frames_); }

}  // namespace stemvo
