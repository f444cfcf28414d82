// SPDX-License-Identifier: MIT
#include "odometry/road/belief.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>

namespace stemvo {
namespace {

// Log-odds: believed from 55 : 1 on, no longer at 1 : 1. The lower bound is farther away: who was
// wrong for long has to be right for long.
constexpr double kBelieved = 4.0;
constexpr double kDisbelieved = 0.0;
constexpr double kMost = 10.0;
constexpr double kLeast = -10.0;

// Log-likelihood ratios, road : anything else. Landmarks seen through a road are on it 75 : 40,
// below it (wrong tracks) 10 : 35, above it (cars, kerbs) 15 : 35.
constexpr double kOn = 0.63;
constexpr double kBelow = -1.25;
constexpr double kAbove = -0.85;
/// One landmark is seen in about seven frames: they are one witness.
constexpr double kLandmarkShare = 0.15;
constexpr double kMostOfLandmarks = 0.75;
constexpr double kLeastOfLandmarks = -1.5;
/// Who has moved by so many heights of the camera sees another piece of road; less is worth less.
constexpr double kNewRoad = 0.3;
// Neighbouring frames share road and errors: each is worth a part of its chi-square.
constexpr double kContinuous = 0.35;
constexpr double kContinuousChi2 = 4.5;  ///< of an innovation that says nothing
constexpr double kLeastOfInnovation = -1.5;
constexpr double kUnmeasured = -0.3;
constexpr double kLeastUnmeasured = -4.0;  ///< nothing seen is less than something wrong
constexpr double kPlainCorrelation = 0.5;  ///< says nothing
constexpr double kMostOfCorrelation = 0.3;
/// Beyond this a slope, a bend or a roll is not the given one by chance (5 % of 2 degrees of
/// freedom).
constexpr double kUnlikelyChi2 = 6.0;
constexpr double kLeastOfPlane = -1.5;

constexpr double kMaxInnovation = 3.0;
/// The filter takes about so much of an innovation: errors that change sooner average out in it.
constexpr double kFilterGain = 0.1;
/// Mean square of a mean by this gain, of independent innovations of 1.
constexpr double kIndependent2 = kFilterGain / (2.0 - kFilterGain);
constexpr double kMinInnovationGain = 0.05;
constexpr double kMinSigmaFactor = 0.5;

double unlikely(double chi2) {
  return std::max(kLeastOfPlane, -std::max(0.0, chi2 / kUnlikelyChi2 - 1.0));
}

double of_landmarks(const RoadEvidence& e) {
  // Things that stand on the road hide it: a measurement that does not see it is wrong.
  const double above = e.measured_share > 0.0 ? kAbove * e.num_above : 0.0;
  return std::clamp(kLandmarkShare * (kOn * e.num_on + kBelow * e.num_below + above),
                    kLeastOfLandmarks, kMostOfLandmarks);
}

double of_innovation(const RoadEvidence& e) {
  const double d = e.innovation.value_or(0.0);
  const double ratio = kContinuous * (1.0 - d * d / kContinuousChi2);
  return ratio > 0.0 ? e.measured_share * ratio : std::max(kLeastOfInnovation, ratio);
}

double of_correlation(const RoadEvidence& e) {
  const double better = e.correlation.value_or(kPlainCorrelation) - kPlainCorrelation;
  const double ratio = std::clamp(better, -kMostOfCorrelation, kMostOfCorrelation);
  // Another plane than before may explain the images, too.
  return of_innovation(e) < 0.0 ? std::min(0.0, ratio) : e.measured_share * ratio;
}

}  // namespace

void RoadBelief::add(const RoadEvidence& e) {
  const bool is_measured = e.measured_share > 0.0;
  // Landmarks do not tell that what was never measured is the road.
  const double landmarks = of_landmarks(e);
  const bool may_tell = is_measured || is_believed_;
  const std::array<std::pair<double, std::string_view>, 5> told = {{
      {may_tell ? landmarks : std::min(0.0, landmarks), "landmarks are not on it"},
      {is_measured ? of_innovation(e) : 0.0, "its scale jumps"},
      {is_measured ? of_correlation(e) : 0.0, "the images hardly agree"},
      {unlikely(e.profile_chi2), "it tilts against the way driven"},
      {unlikely(e.roll_chi2), "it rolls against the camera"},
  }};
  // A wrong measurement jumps, tilts and explains little at once: it is one witness against.
  double sum = told[0].first;
  double against = 0.0;
  for (std::size_t i = 1; i < told.size(); ++i) {
    sum += std::max(0.0, told[i].first);
    against = std::min(against, told[i].first);
  }
  sum += against;
  if (!is_measured && e.is_in_sight && !is_believed_) {
    sum += std::clamp(kLeastUnmeasured - log_odds_, kUnmeasured, 0.0);
  }
  sum *= std::min(1.0, e.travelled / kNewRoad);
  log_odds_ = std::clamp(log_odds_ + sum, kLeast, kMost);
  if (sum < 0.0) {
    const auto worst = std::min_element(told.begin(), told.end());
    doubt_ = worst->first < 0.0 ? worst->second : kUnproven;
  }
  is_believed_ = log_odds_ > (is_believed_ ? kDisbelieved : kBelieved);
  if (e.innovation.has_value()) {
    ++num_innovations_;
    const double gain = std::max(kMinInnovationGain, 1.0 / num_innovations_);
    const double innovation = std::clamp(*e.innovation, -kMaxInnovation, kMaxInnovation);
    mean_innovation_ += kFilterGain * (innovation - mean_innovation_);
    lasting2_ += gain * (mean_innovation_ * mean_innovation_ / kIndependent2 - lasting2_);
  }
}

void RoadBelief::restart() {
  log_odds_ = std::min(log_odds_, 0.5 * kBelieved);
  is_believed_ = false;
  doubt_ = kUnproven;
}

double RoadBelief::sigma_factor() const { return std::max(kMinSigmaFactor, std::sqrt(lasting2_)); }

}  // namespace stemvo
