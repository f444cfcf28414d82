// SPDX-License-Identifier: MIT
#include "odometry/motion_chain.hpp"

#include <algorithm>
#include <cmath>

namespace stemvo {
namespace {

/// Backward travel is believed only with this many times the least parallax and a clear winner of
/// the hypothesis test; otherwise it is the cheirality test's flip of 180 degrees.
constexpr double kReverseParallaxFactor = 3.0;
constexpr double kReverseRunnerUp = 0.5;

/// The paper's forward motion gate: T_z > T_x and T_z > T_y, T = prev_from_cur (signed, as
/// printed).
bool is_forward_in_paper(const Eigen::Vector3d& direction) {
  return direction.z() > direction.x() && direction.z() > direction.y();
}

bool is_mainly_along_z(const Eigen::Vector3d& direction) {
  return std::abs(direction.z()) > std::abs(direction.x()) &&
         std::abs(direction.z()) > std::abs(direction.y());
}

}  // namespace

bool MotionChain::passes_gate(const Eigen::Vector3d& direction_in_prev,
                              const MeasuredMotion& motion) const {
  if (options_.gate == "off") {
    return true;
  }
  if (options_.gate == "paper") {
    return is_forward_in_paper(direction_in_prev);
  }
  if (!is_mainly_along_z(direction_in_prev)) {
    return false;
  }
  return direction_in_prev.z() > 0.0 ||
         (motion.parallax_px > kReverseParallaxFactor * options_.min_parallax_px &&
          motion.runner_up_ratio < kReverseRunnerUp);
}

FrameState MotionChain::add(const MeasuredMotion& motion) {
  const Rigid3 prev_from_cur = motion.cur_from_prev.inverse();
  const Eigen::Vector3d direction = prev_from_cur.translation;
  const int num_frames = frames_since_picture_ + 1;
  const double full_step_m = motion.step > 0.0 ? motion.step : assumed_step_ * num_frames;
  FrameState state = motion.state;
  if (state == FrameState::kTracking) {
    if (!passes_gate(direction, motion)) {
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
      apply(prev_from_cur, full_step_m);
      break;
    case FrameState::kLowParallax:
      // The flow is proportional to the step: a creeping frame moves by its share of a full one.
      apply({prev_from_cur.rotation, last_direction_},
            full_step_m * motion.parallax_px / options_.min_parallax_px);
      break;
    case FrameState::kGated:
      if (options_.gate == "paper") {
        apply({}, 0.0);
      } else {
        apply({prev_from_cur.rotation, last_direction_}, full_step_m);
      }
      break;
    case FrameState::kStationary:
    case FrameState::kRotating:
      apply(prev_from_cur, 0.0);
      break;
    default:
      extrapolate(/*has_picture=*/true);
      break;
  }
  return state;
}

void MotionChain::apply(const Rigid3& prev_from_cur, double step_m) {
  const Eigen::Vector3d step_in_prev = step_m * prev_from_cur.translation;
  const Eigen::Vector3d position =
      world_from_picture_.translation + world_from_picture_.rotation * step_in_prev;
  const Eigen::Quaterniond rotation = options_.composition == "paper"
                                          ? prev_from_cur.rotation * world_from_picture_.rotation
                                          : world_from_picture_.rotation * prev_from_cur.rotation;
  const int num_frames = frames_since_picture_ + 1;
  last_prev_from_cur_ = motion_of_one_frame({prev_from_cur.rotation, step_in_prev}, num_frames);
  world_from_picture_ = {rotation, position};
  world_from_camera_ = world_from_picture_;
  frames_since_picture_ = 0;
}

void MotionChain::extrapolate(bool has_picture) {
  world_from_camera_ = world_from_camera_ * last_prev_from_cur_;
  if (has_picture) {
    world_from_picture_ = world_from_camera_;
    frames_since_picture_ = 0;
    has_picture_ = true;
  } else {
    ++frames_since_picture_;
  }
}

}  // namespace stemvo
