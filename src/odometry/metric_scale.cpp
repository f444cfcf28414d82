// SPDX-License-Identifier: MIT
#include "odometry/metric_scale.hpp"

#include <cmath>
#include <span>
#include <utility>

#include "timing/stage_timer.hpp"

namespace stemvo {
namespace {

constexpr std::size_t kMinKeyframes = 3;
/// A road that is not proven yet scales a map in so many frames, in which one is: later the path
/// would change its unit for what may be a table.
constexpr int kMaxGuessed = 10;
/// One whose scale has a larger logarithm says another order of speed than the assumed one: a
/// table.
constexpr double kMaxGuess = 2.0;
constexpr double kNewLogScale = 0.1;  ///< a unit that changes by more is another one
constexpr double kTrack_px = 0.7;     ///< error of a track over the window
/// Road and ways that differ by more, and by so many sigmas, are not both right.
constexpr double kContradiction = 0.04;
constexpr double kContradictionSigmas = 3.0;
constexpr double kForgotten_s = 5.0;  ///< by 1 / e: what a road said that is not believed now
/// The map does not drift as fast for longer; and a road sees most of it.
constexpr double kMaxAge_s = 10.0;
constexpr double kMaxAgeBesideRoad_s = 0.8;
constexpr double kFewCompared = 0.1;  ///< the mean of ten ways is compared with the road
/// Where a way says what the road's scale is, the road is searched for as far around it.
constexpr double kSearchSigma = 0.3;

}  // namespace

MetricScale::MetricScale(const Options& config, std::optional<double> drift_sigma)
    : filter_(drift_sigma.value_or(kScaleDrift)), road_filter_(filter_) {
  if (config.scale.source != ScaleSource::kCameraHeight) {
    return;
  }
  road_.emplace(RoadOptions{.camera_height_m = config.scale.camera_height_m,
                            .use_dense = config.scale.estimators != RoadEstimators::kPoints,
                            .use_points = config.scale.estimators != RoadEstimators::kDense});
}

void MetricScale::restart(const RoadImage* road, double time_s, bool has_scale) {
  ways_.restart(time_s);
  last_time_s_ = time_s;
  if (!is_enabled() || (road_.has_value() && road == nullptr)) {
    return;
  }
  if (!has_scale) {
    filter_.restart();
    road_filter_.restart();
    is_scale_proven_ = false;
    num_frames_ = 0;
  }
  is_road_believed_ = false;
  is_way_measured_ = false;
  apart_ = 0.0;
  num_compared_ = 0;
  state_ = ScaleState::kNone;
  if (road_.has_value()) {
    road_->restart();
    reason_ = road_->update(*road, {}, road_filter_).reason;
  }
}

double MetricScale::contradiction() const {
  const double apart = std::abs(way_from_road_);
  const double drift = kMapDrift * std::min(ways_.age_s(last_time_s_), kMaxAge_s);
  const double sigma = std::hypot(filter_.sigma(), road_->sigma(road_filter_), drift);
  return apart > std::max(kContradiction, kContradictionSigmas * sigma) ? apart : 0.0;
}

double MetricScale::way_sigma() const {
  const double longest_s = is_road_believed_ && apart_ == 0.0 ? kMaxAgeBesideRoad_s : kMaxAge_s;
  const double drift = kMapDrift * std::min(ways_.age_s(last_time_s_), longest_s);
  // Two that differ a little are joined: the truth may be where one of them is.
  const double between = is_road_believed_ && num_compared_ > 0 ? 0.5 * way_from_road_ : 0.0;
  const double sigma = std::hypot(filter_.way_sigma_factor() * filter_.sigma(), drift);
  return std::min(std::hypot(sigma, std::max(apart_, std::abs(between)), filter_.wander()),
                  ScaleFilter::kUnknownSigma);
}

bool MetricScale::measure_road(const RoadImage& road,
                               const Rigid3& cur_from_prev,
                               const std::vector<RoadLandmark>& landmarks) {
  if (filter_.is_initialized() && !road_filter_.is_initialized()) {
    road_filter_.update(filter_.log_scale(), kSearchSigma, ScaleWitness::kRoad);
  }
  const RoadScaleEstimate estimate = timed(Stage::kRoadScale, [&] {
    return road_->update(road, cur_from_prev, road_filter_, landmarks);
  });
  is_road_believed_ = estimate.is_believed;
  reason_ = estimate.reason;
  if (!has_ways_) {
    filter_ = road_filter_;
    return estimate.is_measured;
  }
  if (is_way_measured_ && estimate.is_measured) {
    if (ways_.have_ended(last_time_s_)) {
      is_way_measured_ = false;  // if the two were apart, they still are
      is_unit_new_ = true;
      num_compared_ = 0;
      filter_ = road_filter_;
    } else if (apart_ = contradiction(); apart_ > 0.0) {
      reason_ = kRoadContradicted;
      return false;
    }
  }
  // A road that is not proven does not bend what ways have measured.
  if (estimate.log_scale && (estimate.is_believed || !is_way_measured_)) {
    filter_.update(estimate.log_scale->first, estimate.log_scale->second, ScaleWitness::kRoad);
  }
  return estimate.is_measured;
}

double MetricScale::measure(const RoadImage* road,
                            const Rigid3& cur_from_prev,
                            double time_s,
                            double pixel_units,
                            const std::vector<RoadLandmark>& landmarks) {
  ways_.move(cur_from_prev, time_s, pixel_units);
  ++num_frames_;
  const double interval_s = time_s - std::exchange(last_time_s_, time_s);
  if (!has_ways_ && (!road_.has_value() || road == nullptr)) {
    return 1.0;
  }
  if (!road_.has_value() || cur_from_prev.translation.norm() > 0.0) {
    filter_.predict(interval_s);
    road_filter_.predict(interval_s);
  }
  const bool is_measured =
      road_.has_value() && road != nullptr && measure_road(*road, cur_from_prev, landmarks);
  if (!is_road_believed_) {  // what it said is forgotten: it may have been none
    apart_ *= std::exp(-interval_s / kForgotten_s);
  }
  const bool is_way_measured = ways_.measure(filter_);
  if (ways_.told() && is_road_believed_) {
    const double gain = std::max(kFewCompared, 1.0 / ++num_compared_);
    way_from_road_ += gain * (*ways_.told() - road_filter_.log_scale() - way_from_road_);
  }
  is_unit_new_ = is_unit_new_ || (is_way_measured && !is_way_measured_);
  is_way_measured_ = is_way_measured_ || is_way_measured;
  state_ = is_measured || is_way_measured          ? ScaleState::kMeasured
           : is_road_believed_ || is_way_measured_ ? ScaleState::kHeld
                                                   : ScaleState::kNone;
  const bool is_proven = is_scale_proven_ || is_road_believed_ || is_way_measured_;
  is_scale_new_ = is_proven && (!is_scale_proven_ || is_unit_new_) && num_frames_ > kMaxGuessed &&
                  std::abs(filter_.log_scale()) > kNewLogScale;
  is_scale_proven_ = is_proven;
  const bool may_guess = num_frames_ <= kMaxGuessed && std::abs(filter_.log_scale()) < kMaxGuess;
  if (!filter_.is_initialized() || !(is_proven || may_guess)) {
    return 1.0;
  }
  const double metres_per_unit = std::exp(filter_.log_scale());
  rescale(metres_per_unit);
  is_unit_new_ = false;
  return metres_per_unit;
}

std::vector<RoadLandmark> road_landmarks(const Window& window,
                                         const Rigid3& world_from_camera,
                                         const Observations& seen,
                                         const Camera& camera) {
  std::vector<RoadLandmark> result;
  const Rigid3 camera_from_world = world_from_camera.inverse();
  ObservationWalk walk(window);
  for (const Observation& point : seen) {
    const auto landmark = window.landmarks.find(point.track_id);
    if (landmark == window.landmarks.end()) {
      continue;
    }
    const Eigen::Vector3d here = camera_from_world * landmark->second;
    const std::span<const KeyframeObservation> views = walk.seek(point.track_id);
    if (!(here.z() > 0.0) || views.size() < kMinKeyframes) {
      continue;
    }
    const Eigen::Vector3d first =
        camera_from_world * window.keyframes[views.front().keyframe].world_from_camera.translation;
    // The sine of the parallax between the first view and this one.
    const double parallax = first.cross(here.normalized()).norm() / (here - first).norm();
    if (parallax > 0.0) {
      result.push_back({here, kTrack_px / (camera.mean_focal_px() * parallax)});
    }
  }
  return result;
}

}  // namespace stemvo
