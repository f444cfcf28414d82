// SPDX-License-Identifier: MIT
#include "odometry/road_scale.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace stemvo {

namespace {

constexpr double kTypicalStep_m = 0.8;  ///< where a search for the first scale starts
constexpr double kMinPriorSigma = 0.03;
constexpr double kSearchSigma = 0.3;
constexpr int kFramesUntilSearch = 5;
/// Nearer than this share of the wanted baseline, a pair of frames is not worth looking at.
constexpr double kStandingShare = 0.25;

}  // namespace

RoadScale::RoadScale(const RoadOptions& options, const Camera& camera)
    : options_(options), camera_(camera), dense_(options), filter_(options) {}

void RoadScale::rescale(double factor) {
  filter_.shift(-std::log(factor));
  for (Past& past : past_) {
    past.now_from_past.translation *= factor;
  }
}

void RoadScale::restart() {
  filter_.restart();
  past_.clear();
  frames_unmeasured_ = 0;
}

const RoadScale::Past* RoadScale::pick_past() const {
  if (past_.empty() || !(past_.front().now_from_past.translation.norm() > 0.0)) {
    return nullptr;
  }
  if (!filter_.is_initialized()) {
    return &past_.front();
  }
  const double metres_per_unit = std::exp(filter_.log_scale());
  const Past* best = nullptr;
  for (const Past& past : past_) {
    const double baseline_m = past.now_from_past.translation.norm() * metres_per_unit;
    if (baseline_m >= kStandingShare * options_.min_baseline_m) {
      best = &past;
    }
    if (baseline_m >= options_.min_baseline_m) {
      break;
    }
  }
  return best;
}

RoadPrior RoadScale::make_prior(const Rigid3& motion) const {
  RoadPrior prior;
  const double length = motion.translation.norm();
  prior.log_scale = filter_.log_scale();
  prior.log_scale_sigma = std::max(kMinPriorSigma, filter_.sigma());
  if (!filter_.is_initialized()) {
    prior.log_scale = std::log(kTypicalStep_m / length);
    prior.log_scale_sigma = RoadFilter::kUnknownSigma;
  } else if (frames_unmeasured_ >= kFramesUntilSearch) {
    prior.log_scale_sigma = std::max(prior.log_scale_sigma, kSearchSigma);
  }
  // A car drives along the road, whatever the pitch of its camera: the plane's horizon goes through
  // the point it drives to, but for its bouncing and the road's curvature.
  const Eigen::Vector3d& t = motion.translation;
  if (t.z() < -0.5 * length) {
    prior.slope_rad = t.y() / t.z();
    prior.slope_sigma = options_.slope_sigma;
  }
  return prior;
}

void RoadScale::remember(RoadPicture picture) {
  past_.push_front({std::move(picture), Rigid3{}});
  if (past_.size() > static_cast<std::size_t>(std::max(1, options_.max_frames_apart))) {
    past_.pop_back();
  }
}

RoadScaleEstimate RoadScale::estimate() const {
  RoadScaleEstimate result;
  result.is_initialized = filter_.is_initialized();
  result.metres_per_unit = std::exp(filter_.log_scale());
  result.sigma = filter_.sigma();
  return result;
}

RoadScaleEstimate RoadScale::update(const ChannelImage& image, const Rigid3& cur_from_prev) {
  if (!cur_from_prev.matrix().allFinite()) {
    restart();
  }
  RoadPicture picture = make_road_picture(image, camera_);
  for (Past& past : past_) {
    past.now_from_past = cur_from_prev * past.now_from_past;
  }
  RoadScaleEstimate result;
  const Past* past = pick_past();
  if (past == nullptr) {
    const bool is_first = past_.empty();
    result = estimate();
    result.reason = is_first ? "first frame" : "standing still";
    if (is_first) {
      remember(std::move(picture));
    }
    return result;
  }
  filter_.predict();
  const Rigid3& motion = past->now_from_past;
  const RoadMeasurement dense = dense_.measure(past->picture, picture, motion, make_prior(motion));
  const bool is_measured = dense.is_valid && filter_.update(dense.log_scale, dense.sigma);
  frames_unmeasured_ = is_measured ? 0 : frames_unmeasured_ + 1;
  remember(std::move(picture));
  result = estimate();
  result.is_measured = is_measured;
  result.dense = dense;
  if (!is_measured) {
    result.reason = dense.is_valid ? "differs from the frames before" : dense.reason;
  }
  return result;
}

}  // namespace stemvo
