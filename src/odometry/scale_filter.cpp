// SPDX-License-Identifier: MIT
#include "odometry/scale_filter.hpp"

#include <algorithm>

namespace stemvo {
namespace {

constexpr double kHuber = 1.5;
constexpr double kDoubt = 3.0;  ///< standard deviations
/// In a row, for as long as it was believed before, within these: off the road, in a tight turn,
/// dozens of frames tell the same wrong scale, and the map does not drift as fast.
constexpr double kMinDoubt_s = 0.4;
constexpr double kMaxDoubt_s = 3.2;
/// One measurement counts for the time since the one before, but for no more.
constexpr double kMaxShare_s = 0.2;
/// Roads measured so often have the sigma given; errors last for about four of them.
constexpr double kRoadInterval_s = 0.1;
constexpr double kMaxRoads = 4.0;
constexpr double kRounding_s = 1e-6;  ///< of sums
/// A first measurement may be the wrong peak of a search over scales: others must confirm it.
constexpr double kFirstSigma = 0.1;
/// Drift in a second between ways without a road: the path adds up ways, whose errors average out
/// where it follows them; what is smoothed into neighbours lasts, an error at the start above all.
constexpr double kWayDrift = 0.02;
constexpr double kDistanceGain = 0.1;
constexpr double kMaxDistance2 = 25.0;
/// The scale against its mean over two seconds: a map's drift takes it so far, what contradicts the
/// motion (speeds of another second) farther. Not before it is known that well.
constexpr double kMean_s = 2.0;
constexpr double kSteady = 0.04;
constexpr double kSettled = 0.03;
constexpr double kForgotten_s = 3.0;  ///< by 1 / e
constexpr double kTrend_s = 10.0;     ///< a trend that nothing confirms is forgotten by 1 / e

}  // namespace

void ScaleFilter::predict(double interval_s) {
  sigma_ = std::min(std::hypot(sigma_, std::sqrt(interval_s) * drift_sigma_), kUnknownSigma);
  log_scale_ += interval_s * trend_;
  trend_ *= std::exp(-interval_s / kTrend_s);
  from_mean_ = (from_mean_ + interval_s * trend_) * std::exp(-interval_s / kMean_s);
  wander_ =
      std::max(wander_ * std::exp(-interval_s / kForgotten_s), std::abs(from_mean_) - kSteady);
  for (Record& one : records_) {
    one.since_s += interval_s;
  }
}

bool ScaleFilter::update(double log_scale, double sigma, ScaleWitness witness) {
  if (!is_initialized_) {
    is_initialized_ = true;
    record(witness).since_s = 0.0;
    log_scale_ = log_scale;
    sigma_ = std::max(sigma, kFirstSigma);
    return true;
  }
  const bool is_road = witness == ScaleWitness::kRoad;
  const double way_s = record(ScaleWitness::kWay).since_s;
  if (!is_road && record(ScaleWitness::kRoad).since_s > way_s) {
    const double drift = std::sqrt(std::min(way_s, kMaxShare_s)) * kWayDrift;
    sigma_ = std::min(std::hypot(sigma_, drift), kUnknownSigma);
  }
  const double innovation = log_scale - log_scale_;
  const bool is_first = sigma_ >= kUnknownSigma;
  if (!is_road) {
    const double distance2 = std::pow(innovation / std::hypot(sigma, sigma_), 2);
    way_distance2_ += kDistanceGain * (std::min(distance2, kMaxDistance2) - way_distance2_);
  }
  const double distance = judge(innovation, sigma, witness);
  // Huber's weight of a residual d is kHuber / d, so the variance grows by d / kHuber; beyond
  // kDoubt it grows by d / kDoubt once more: an outlier then moves the state less the farther it
  // is.
  const double growth = std::max(1.0, distance / kHuber) * std::max(1.0, distance / kDoubt);
  const double num_roads = std::min(record(witness).since_s / kRoadInterval_s, kMaxRoads);
  const double variance = sigma * sigma * growth / (is_road ? num_roads : 1.0);
  const double gain = sigma_ * sigma_ / (sigma_ * sigma_ + variance);
  if (is_road) {
    trend_ = 0.0;
  } else {
    // Critical damping; not from a state that is yet to be found.
    const double since_s = std::min(records_[0].since_s, records_[1].since_s);
    const bool is_trend = sigma_ < sigma && since_s > 0.0;
    trend_ += is_trend ? 0.25 * gain * gain * innovation / since_s : 0.0;
  }
  record(witness).since_s = 0.0;
  log_scale_ += gain * innovation;
  from_mean_ = sigma_ > kSettled ? 0.0 : from_mean_ + gain * innovation;
  sigma_ = std::max(sigma_ * std::sqrt(1.0 - gain), is_first ? kFirstSigma : 0.0);
  return distance < kDoubt;
}

double ScaleFilter::judge(double innovation, double sigma, ScaleWitness witness) {
  auto& [since_s, doubted_s, believed_s] = record(witness);
  const double share_s = std::min(since_s, kMaxShare_s);
  const double distance = std::abs(innovation) / std::hypot(sigma, sigma_);
  if (distance < kDoubt) {
    doubted_s = 0.0;
    believed_s = std::min(believed_s + share_s, kMaxDoubt_s);
    if (witness == ScaleWitness::kWay) {
      record(ScaleWitness::kRoad).doubted_s = 0.0;
    }
    return distance;
  }
  const double before_s = doubted_s * innovation > 0.0 ? doubted_s : 0.0;
  doubted_s = before_s + std::copysign(share_s, innovation);
  if (std::abs(doubted_s) < std::max(believed_s, kMinDoubt_s) - kRounding_s) {
    return distance;
  }
  doubted_s = 0.0;
  believed_s = 0.0;
  trend_ = 0.0;
  sigma_ = std::min(std::abs(innovation), kUnknownSigma);
  return std::abs(innovation) / std::hypot(sigma, sigma_);
}

}  // namespace stemvo
