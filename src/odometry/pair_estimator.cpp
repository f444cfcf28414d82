// SPDX-License-Identifier: MIT
#include "odometry/pair_estimator.hpp"

#include <cstddef>

namespace stemvo {
namespace {

/// A unit is the last step: what drifts is the car's speed, its log between frames ..
constexpr double kSpeedSigma = 0.02;
constexpr double kSpeedDrift = 0.063;  ///< .. and in a second

/// The paper's forward motion gate: T_z > T_x and T_z > T_y, T = prev_from_cur (signed, as
/// printed).
bool is_forward_in_paper(const Eigen::Vector3d& direction) {
  return direction.z() > direction.x() && direction.z() > direction.y();
}

}  // namespace

FrameState MotionChain::add(const MeasuredMotion& motion, double length) {
  const Rigid3 prev_from_cur = motion.cur_from_prev.inverse();
  const Eigen::Vector3d direction = prev_from_cur.translation;
  const double full_length = length > 0.0 ? length : assumed_speed_ * since_image_s();
  FrameState state = motion.state;
  if (state == FrameState::kTracking) {
    if (options_.gate == ForwardGate::kPaper && !is_forward_in_paper(direction)) {
      state = FrameState::kGated;
    } else if (is_initializing_) {
      state = FrameState::kInitializing;
    }
  }
  switch (state) {
    case FrameState::kTracking:
    case FrameState::kInitializing:
      is_initializing_ = is_initializing_ && !motion.is_decisive;
      last_direction_ = direction.normalized();
      apply(prev_from_cur, full_length);
      break;
    case FrameState::kLowParallax:
      // The flow is proportional to the step: a creeping frame moves by its share of a full one.
      apply({prev_from_cur.rotation, last_direction_},
            full_length * motion.parallax_px / options_.min_parallax_px);
      break;
    case FrameState::kGated:
      apply({}, 0.0);
      break;
    case FrameState::kStationary:
    case FrameState::kRotating:
      apply(prev_from_cur, 0.0);
      break;
    default:
      extrapolate(/*has_image=*/true);
      break;
  }
  return state;
}

PairEstimator::PairEstimator(const Options& config, const Camera& camera)
    : options_(config.odometry),
      camera_(camera),
      two_view_(config),
      chain_(config.odometry, config.scale),
      scale_(config, kSpeedDrift) {}

LocalizedFrame PairEstimator::localize(const Frame& frame) {
  LocalizedFrame localized;
  const Matches& matches = frame.matches;
  motion_ = {};
  chain_.advance_to(frame.time_s, trust_.trusted(frame.hints));
  times_s_.push_back(frame.time_s);
  if (!frame.has_image()) {
    motion_.state = FrameState::kNoImage;
  } else if (last_image_ < 0) {
    motion_.state = FrameState::kFirst;
  } else {
    if (matches.prev_frame >= 0 && matches.prev_frame != last_image_) {
      const auto prev = static_cast<std::size_t>(matches.prev_frame);
      chain_.go_back(trajectory_[prev], times_s_[prev]);
    }
    motion_ =
        two_view_.measure({matches.prev_uv, matches.cur_uv}, camera_, chain_.is_initializing());
  }
  localized.inlier_mask = motion_.inlier_mask;
  localized.result.num_matches = static_cast<int>(matches.cur_uv.size());
  localized.result.num_inliers = motion_.num_inliers;
  add_scores(motion_, localized.result);
  return localized;
}

void PairEstimator::optimize(const Frame& frame, LocalizedFrame& localized) {
  FrameResult& result = localized.result;
  result.state = motion_.state;
  scale_.add(frame.ways);
  if (motion_.state == FrameState::kNoImage) {
    chain_.extrapolate(/*has_image=*/false);
    scale_.keep_last("no image", frame.time_s);
  } else if (motion_.state == FrameState::kFirst) {
    scale_.restart(frame.road.get(), frame.time_s);
  } else {
    result.state = chain_.add(motion_, measure_length(frame));
    if (motion_.state != FrameState::kLost && frame.matches.prev_frame == frame.number - 1) {
      trust_.compare(frame.hints, motion_.cur_from_prev.rotation.conjugate());
    }
  }
  last_image_ = frame.has_image() ? frame.number : last_image_;
  scale_.report(result);
  result.is_measured = is_measured(result.state);
  result.camera = camera_;
  result.world_from_camera = chain_.world_from_camera();
  const double interval_s = times_s_.size() > 1 ? times_s_.back() - *(times_s_.end() - 2) : 0.0;
  const double speed = last_speed_ > 0.0 ? last_speed_ : chain_.assumed_speed();
  const MotionCovariance::Motion motion{
      .state = result.state,
      .is_localized = is_measured(result.state) || result.state == FrameState::kGated,
      .prev_from_cur =
          trajectory_.empty() ? Rigid3() : trajectory_.back().inverse() * result.world_from_camera,
      .dt_s = interval_s,
      .usual_step = speed * interval_s,
      .hidden_px = options_.stationary_flow_px,
      .two_view = motion_.covariance,
      .camera = camera_,
      .camera_sigma = std::nullopt,
      .scale_sigma = metric_sigma(result).value_or(kSpeedSigma)};
  result.motion_covariance = uncertainty_.finish(motion);
  trajectory_.push_back(result.world_from_camera);
}

/// The motion's length; 0 where it is not measured.
double PairEstimator::measure_length(const Frame& frame) {
  if (!scale_.is_enabled()) {
    return 0.0;
  }
  const bool is_lost = motion_.state == FrameState::kLost;
  if (is_lost || frame.matches.prev_frame != last_image_) {  // the road was last seen elsewhere
    scale_.restart(frame.road.get(), frame.time_s);
    return 0.0;
  }
  const bool has_length = motion_.state == FrameState::kTracking;
  const double interval_s = has_length ? chain_.since_image_s() : 0.0;
  last_speed_ = last_speed_ > 0.0 ? last_speed_ : chain_.assumed_speed();
  const Rigid3& direction = motion_.cur_from_prev;
  const Rigid3 motion(direction.rotation, interval_s * last_speed_ * direction.translation);
  last_speed_ *= scale_.measure(frame.road.get(), motion, frame.time_s, /*pixel_units=*/0.0);
  if (!has_length) {
    scale_.cut_path(frame.time_s);
  }
  return interval_s * last_speed_;
}

}  // namespace stemvo
