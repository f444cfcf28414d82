// SPDX-License-Identifier: MIT
#include "odometry/road/scale.hpp"

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

void RoadScale::rescale(double factor) {
  path_.rescale(factor);
  for (Past& past : past_) {
    past.now_from_past.translation *= factor;
  }
}

void RoadScale::restart() {
  past_.clear();
  path_.restart();
  frames_unmeasured_ = 0;
}

const RoadScale::Past* RoadScale::pick_past(const ScaleFilter& filter) const {
  if (past_.empty() || !(past_.front().now_from_past.translation.norm() > 0.0)) {
    return nullptr;
  }
  if (!filter.is_initialized()) {
    return &past_.front();
  }
  const double metres_per_unit = std::exp(filter.log_scale());
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

RoadPrior RoadScale::make_prior(const Rigid3& motion, const ScaleFilter& filter) const {
  RoadPrior prior;
  prior.roll_sigma = options_.roll_sigma_rad;
  prior.log_scale = filter.log_scale();
  prior.log_scale_sigma = std::max(kMinPriorSigma, filter.sigma());
  if (!filter.is_initialized()) {
    prior.log_scale = std::log(kTypicalStep_m / motion.translation.norm());
    prior.log_scale_sigma = ScaleFilter::kUnknownSigma;
  } else if (frames_unmeasured_ >= kFramesUntilSearch) {
    prior.log_scale_sigma = std::max(prior.log_scale_sigma, kSearchSigma);
  }
  path_.predict(std::exp(prior.log_scale), prior);
  return prior;
}

void RoadScale::remember(RoadImage image) {
  past_.push_front({std::move(image), Rigid3{}});
  if (past_.size() > static_cast<std::size_t>(std::max(1, options_.max_frames_apart))) {
    past_.pop_back();
  }
}

std::string_view RoadScale::measure(const Past& past, const RoadImage& image, ScaleFilter& filter) {
  RoadPrior prior = make_prior(past.now_from_past, filter);
  const RoadStep step{past.image, image, past.now_from_past, prior, options_};
  RoadMeasurement dense;
  RoadMeasurement points;
  if (options_.use_dense || !filter.is_initialized()) {  // the corners cannot search for a scale
    dense = measure_dense(step);
  }
  if (options_.use_points) {
    if (dense.is_valid) {
      prior.log_scale = dense.log_scale;  // where to look, not what to find
    }
    points = measure_points(step);
  }
  double weight = 0.0;
  double sum = 0.0;
  for (const RoadMeasurement* road : {&dense, &points}) {
    if (road->is_valid) {
      weight += 1.0 / (road->sigma * road->sigma);
      sum += road->log_scale / (road->sigma * road->sigma);
    }
  }
  if (!(weight > 0.0)) {
    return options_.use_dense ? dense.reason : points.reason;
  }
  // They share the error of flatness_sigma: the same road, not quite as the model.
  const double sigma = std::hypot(1.0 / std::sqrt(weight), options_.flatness_sigma);
  const bool is_believed = filter.update(sum / weight, sigma, ScaleWitness::kRoad);
  return is_believed ? "" : "differs from the frames before";
}

RoadScaleEstimate RoadScale::update(RoadImage image,
                                    const Rigid3& cur_from_prev,
                                    ScaleFilter& filter) {
  if (!past_.empty()) {
    path_.move(cur_from_prev);
  }
  for (Past& past : past_) {
    past.now_from_past = cur_from_prev * past.now_from_past;
  }
  RoadScaleEstimate result;
  const Past* past = pick_past(filter);
  if (past != nullptr) {
    filter.predict();
    result.reason = measure(*past, image, filter);
    result.is_measured = result.reason.empty();
    frames_unmeasured_ = result.is_measured ? 0 : frames_unmeasured_ + 1;
    remember(std::move(image));
  } else if (past_.empty()) {
    result.reason = "first frame";
    remember(std::move(image));
  } else {
    result.reason = "standing still";
  }
  result.is_initialized = filter.is_initialized();
  result.metres_per_unit = std::exp(filter.log_scale());
  result.sigma = filter.sigma();
  return result;
}

}  // namespace stemvo
