// SPDX-License-Identifier: MIT
#include "odometry/metric_scale.hpp"

#include <cmath>

#include "timing/stage_timer.hpp"

namespace stemvo {
namespace {

/// Drift of log(metres per unit), per frame: the map stretches by 0.1 % a frame on real clips,
/// steadily; a random walk must be loose enough to follow without lagging behind.
constexpr double kDriftSigma = 0.006;

}  // namespace

MetricScale::MetricScale(const Options& config, std::optional<double> drift_sigma)
    : filter_(drift_sigma.value_or(kDriftSigma), config.scale.temporal_filter) {
  if (config.scale.source != ScaleSource::kCameraHeight) {
    return;
  }
  RoadOptions options;
  options.camera_height_m = config.scale.camera_height_m;
  options.use_dense = config.scale.estimators != RoadEstimators::kPoints;
  options.use_points = config.scale.estimators != RoadEstimators::kDense;
  road_.emplace(options);
}

void MetricScale::restart(const RoadImage* road) {
  if (road_.has_value() && road != nullptr) {
    filter_.restart();
    road_->restart();
    keep(road_->update(*road, {}, filter_));
  }
}

double MetricScale::measure(const RoadImage* road,
                            const Rigid3& cur_from_prev,
                            const std::vector<RoadLandmark>& landmarks) {
  if (!road_.has_value() || road == nullptr) {
    return 1.0;
  }
  const RoadScaleEstimate estimate = timed(
      Stage::kRoadScale, [&] { return road_->update(*road, cur_from_prev, filter_, landmarks); });
  keep(estimate);
  if (!estimate.is_initialized) {
    return 1.0;
  }
  filter_.shift(-std::log(estimate.metres_per_unit));
  road_->rescale(estimate.metres_per_unit);
  return estimate.metres_per_unit;
}

void MetricScale::keep_last(std::string_view reason) {
  if (road_.has_value()) {
    filter_.predict();
    sigma_ = road_->sigma(filter_);
    state_ = state_ == ScaleState::kMeasured ? ScaleState::kHeld : state_;
    reason_ = reason;
  }
}

void MetricScale::set_unknown(std::string_view reason) {
  if (road_.has_value()) {
    state_ = ScaleState::kNone;
    sigma_ = ScaleFilter::kUnknownSigma;
    reason_ = reason;
  }
}

void MetricScale::keep(const RoadScaleEstimate& estimate) {
  sigma_ = estimate.sigma;
  state_ = estimate.is_measured   ? ScaleState::kMeasured
           : estimate.is_believed ? ScaleState::kHeld
                                  : ScaleState::kNone;
  reason_ = estimate.reason;
}

void MetricScale::report(FrameResult& result) const {
  result.scale_state = state_;
  result.road_reason = reason_;
  result.scale_sigma = sigma_;
}

}  // namespace stemvo
