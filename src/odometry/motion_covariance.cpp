// SPDX-License-Identifier: MIT
#include "odometry/motion_covariance.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <map>
#include <numeric>
#include <utility>

#include <Eigen/LU>

#include "odometry/localization.hpp"

namespace stemvo {
namespace {

/// Squares of adjustments are means of so many: a window's length.
constexpr int kMemory = 8;
/// Changes of velocity are means over so long: a step of who walks, to either side.
constexpr double kRemembers_s = 2.0;
/// Keyframes that an adjustment spreads an error over: the newer half of the window, which it
/// moves, and the one before.
constexpr double kSpread = 5.0;
/// However many runs SelfCalibration has seen, it misses the principal point by so much: tracks
/// bend alike in turns to one side (measured on rendered drives, self_calibration.cpp).
constexpr double kBend_px = 0.65;

Matrix6d square(const Vector6d& value) { return value * value.transpose(); }

Matrix6d transformed(const Matrix6d& covariance, const Matrix6d& by) {
  return by * covariance * by.transpose();
}

void add_to_mean(const Matrix6d& value, Matrix6d& mean, int& count) {
  count = std::min(count + 1, kMemory);
  mean += (value - mean) / count;
}

Matrix6d diagonal(double translation, double rotation) {
  Vector6d sigma;
  sigma << Eigen::Vector3d::Constant(translation), Eigen::Vector3d::Constant(rotation);
  return sigma.cwiseAbs2().asDiagonal();
}

PoseInfluences influences_of(const SeenLandmarks& seen,
                             const Rigid3& world_from_camera,
                             const MotionCovariance::InMap& at) {
  return pose_influences(world_from_camera.inverse(), seen.points, seen.uv, at.camera, at.loss_px);
}

/// A shift of the principal point turns all poses alike.
Matrix6d principal_point_term(const MotionCovariance::Motion& motion, const Matrix6d& to_cur) {
  if (!motion.camera_sigma.has_value()) {
    return Matrix6d::Zero();
  }
  Matrix6d turn = Matrix6d::Zero();
  const CameraSigma& sigma = *motion.camera_sigma;
  turn(3, 3) = std::pow(std::hypot(sigma.cy_px, kBend_px) / motion.camera.fy_px, 2);
  turn(4, 4) = std::pow(std::hypot(sigma.cx_px, kBend_px) / motion.camera.fx_px, 2);
  return transformed(turn, to_cur - Matrix6d::Identity());
}

Matrix6d scale_term(const MotionCovariance::Motion& motion) {
  Vector6d error = Vector6d::Zero();
  error.head<3>() = motion.scale_sigma.value_or(0.0) *
                    (motion.prev_from_cur.rotation.conjugate() * motion.prev_from_cur.translation);
  return square(error);
}

/// Two views know the rotation and, once they are tracking or have opened a map, the direction.
Matrix6d two_view_motion(const MotionCovariance::Motion& motion) {
  const Matrix6d pair = motion.two_view.value_or(Matrix6d::Zero());
  const double length = motion.prev_from_cur.translation.norm();
  const bool opens_map =
      motion.state == FrameState::kInitializing && motion.is_localized && length > 0.0;
  if (motion.state == FrameState::kTracking || opens_map) {
    Vector6d scale;
    scale << Eigen::Vector3d::Constant(length), Eigen::Vector3d::Ones();
    return scale.asDiagonal() * pair * scale.asDiagonal();
  }
  Matrix6d unknown = diagonal(std::max(length, motion.usual_step),
                              motion.hidden_px / motion.camera.mean_focal_px());
  unknown.bottomRightCorner<3, 3>() += pair.bottomRightCorner<3, 3>();
  return unknown;
}

}  // namespace

void MotionCovariance::localized(const InMap& at, const Observations& points) {
  points_ = points;
  const SeenLandmarks now = find_seen_landmarks(at.window, points);
  influences_ = influences_of(now, at.world_from_camera, at);
  if (!is_prev_localized_) {
    return;
  }
  const SeenLandmarks before = find_seen_landmarks(at.window, prev_points_);
  const PoseInfluences prev = influences_of(before, at.world_from_prev, at);
  const Matrix6d to_cur = adjoint(at.world_from_camera.inverse() * at.world_from_prev);
  std::map<int, Vector6d> of_track;
  for (std::size_t i = 0; i < now.track_ids.size(); ++i) {
    of_track[now.track_ids[i]] = -influences_.of_point[i];
  }
  for (std::size_t i = 0; i < before.track_ids.size(); ++i) {
    of_track.try_emplace(before.track_ids[i], Vector6d::Zero()).first->second +=
        to_cur * prev.of_point[i];
  }
  track_noise_ = Matrix6d::Zero();
  for (const auto& [track_id, influence] : of_track) {
    *track_noise_ += square(influence);
  }
}

void MotionCovariance::adjusted(const InMap& at) {
  if (!is_prev_localized_) {
    return;
  }
  const auto sum_at = [&](const Observations& seen, const Rigid3& pose) {
    const PoseInfluences of = influences_of(find_seen_landmarks(at.window, seen), pose, at);
    return std::accumulate(of.of_point.begin(), of.of_point.end(), Vector6d::Zero().eval());
  };
  const Matrix6d to_cur = adjoint(at.world_from_camera.inverse() * at.world_from_prev);
  step_ = to_cur * sum_at(prev_points_, at.world_from_prev) - sum_at(points_, at.world_from_camera);
}

Matrix6d MotionCovariance::finish(const Motion& motion) {
  has_begun_ = has_begun_ || motion.state != FrameState::kNoImage;
  if (!has_begun_) {
    return Matrix6d::Zero();
  }
  const bool goes_on = motion.state == FrameState::kLost || motion.state == FrameState::kNoImage;
  const Matrix6d to_cur = adjoint(motion.prev_from_cur.inverse());
  Matrix6d pose = transformed(prev_pose_, to_cur);  // until now: of the one before
  Matrix6d covariance = Matrix6d::Zero();
  if (goes_on) {
    const double before_s = std::exchange(unmeasured_s_, unmeasured_s_ + motion.dt_s);
    const Matrix6d change = change_of_velocity(motion);
    const Vector6d faded = std::exchange(faded_, faded_ + motion.faded);
    covariance = motion.dt_s * motion.dt_s * change + square(motion.faded);
    pose += (std::pow(unmeasured_s_, 3) - std::pow(before_s, 3)) / (3.0 * unmeasured_s_) * change +
            square(faded_) - square(faded);
  } else if (!motion.is_localized || motion.two_view.has_value()) {
    covariance = two_view_motion(motion) + pose;
    pose = motion.is_localized ? Matrix6d::Zero() : covariance;
  } else {
    const Matrix6d own = influences_.squared_sum();
    covariance = track_noise_.value_or(own + pose) + map_term(motion.state);
    pose = own;
    if (motion.fused.has_value()) {
      covariance = transformed(covariance, motion.fused->gain) + motion.fused->rest;
    }
  }
  covariance += principal_point_term(motion, to_cur) + scale_term(motion);
  covariance = 0.5 * (covariance + covariance.transpose()).eval();
  covariance.diagonal() *= 1.0 + 1e-9;  // what rounding may cost
  covariance += diagonal(1e-6 * motion.usual_step, 1e-6);

  learn(motion);
  prev_pose_ = pose;
  const bool is_first = motion.state == FrameState::kFirst;
  if (is_first) {
    prev_pose_.setZero();
  }
  return is_first ? Matrix6d::Zero() : covariance;
}

void MotionCovariance::rescale(double factor) {
  Vector6d lengths = Vector6d::Ones();
  lengths.head<3>().setConstant(factor);
  const Matrix6d by = lengths.asDiagonal();
  for (Matrix6d* one : {&prev_pose_, &mean_step_}) {
    *one = transformed(*one, by);
  }
  if (track_noise_) {
    track_noise_ = transformed(*track_noise_, by);
  }
  if (step_) {
    *step_ = by * *step_;
  }
  for (Velocity& velocity : velocities_) {
    velocity.per_s = by * velocity.per_s;
  }
  faded_ = by * faded_;
  for (Vector6d& influence : influences_.of_point) {
    influence = by * influence;
  }
}

/// Its square since the last measured one, as it was between tracked frames so far apart: a hand
/// that begins to turn goes on with it, so that changes from frame to frame tell too little.
Matrix6d MotionCovariance::change_of_velocity(const Motion& motion) const {
  const double span_s =
      velocities_.empty() ? 0.0 : velocities_.back().time_s - velocities_.front().time_s;
  if (!(span_s > 0.0)) {
    // Nothing is known yet: a whole step, and as much of a turn as leaves anything in view.
    const double half_view = std::atan(0.5 * motion.camera.width_px / motion.camera.fx_px);
    return diagonal(motion.usual_step, half_view) * unmeasured_s_ / std::pow(motion.dt_s, 3);
  }
  // Of the way and of the turn, alike along all axes: so few frames tell less of directions.
  const auto squares_after = [&](double lag_s) {
    Eigen::Array2d sum(0.0, 0.0);
    int count = 0;
    auto before = velocities_.begin();
    for (const Velocity& now : velocities_) {
      while (std::next(before)->time_s <= now.time_s - lag_s) {
        ++before;
      }
      if (const double apart_s = now.time_s - before->time_s; apart_s >= lag_s) {
        const Vector6d change = now.per_s - before->per_s;
        sum += unmeasured_s_ / apart_s *
               Eigen::Array2d(change.head<3>().squaredNorm(), change.tail<3>().squaredNorm());
        ++count;
      }
    }
    return (sum / (3 * std::max(count, 1))).eval();
  };
  constexpr double kNextFrame_s = 1e-9;
  const Eigen::Array2d sigmas =
      squares_after(kNextFrame_s).max(squares_after(std::min(unmeasured_s_, 0.5 * span_s))).sqrt();
  return diagonal(sigmas[0], sigmas[1]);
}

/// An adjustment takes away the error that has grown since the last one, frame by frame the same
/// way, but for the share of one of the keyframes it is spread over.
Matrix6d MotionCovariance::map_term(FrameState state) {
  if (!step_.has_value() && state != FrameState::kTracking) {
    return Matrix6d::Zero();
  }
  const double num_frames = step_.has_value() ? kSpread : ++frames_since_step_ + 1.0;
  Matrix6d result = mean_step_ / (num_frames * num_frames);
  if (step_.has_value()) {
    frames_since_step_ = 0;
    result += square(*step_);
    add_to_mean(square(*step_), mean_step_, num_steps_);
  }
  return result;
}

void MotionCovariance::learn(const Motion& motion) {
  const bool is_tracked = motion.is_localized && motion.state == FrameState::kTracking;
  is_prev_localized_ = motion.is_localized;
  prev_points_ = std::exchange(points_, {});
  track_noise_.reset();
  step_.reset();
  if (motion.is_localized) {
    unmeasured_s_ = 0.0;
    faded_.setZero();
  }
  time_s_ += motion.dt_s;
  if (is_tracked) {
    const Rigid3& step = motion.prev_from_cur;
    Vector6d way;
    way << step.rotation.conjugate() * step.translation, so3_log(step.rotation);
    velocities_.push_back({time_s_, way / motion.dt_s});
    while (velocities_.front().time_s < time_s_ - kRemembers_s) {
      velocities_.pop_front();
    }
  }
}

}  // namespace stemvo
