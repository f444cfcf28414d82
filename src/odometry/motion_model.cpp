// SPDX-License-Identifier: MIT
#include "odometry/motion_model.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/LU>

namespace stemvo {
namespace {

/// Speeds a second apart are compared over about so long.
constexpr double kMemory_s = 5.0;
/// A frame or two that are missed change no speed; within a second it fades to what lasts.
constexpr double kBegins_s = 0.3;
constexpr double kFades_s = 1.0;
/// Pushes are means over so long.
constexpr double kLearns_s = 1.0;
/// A measurement so many sigmas from the prediction: something pushes.
constexpr double kPushed = 3.0;

Vector6d six_of(const Rigid3& prev_from_cur) {
  Vector6d six;
  six << prev_from_cur.translation, so3_log(prev_from_cur.rotation);
  return six;
}

Rigid3 motion_of(const Vector6d& six) { return {so3_exp(six.tail<3>()), six.head<3>()}; }

struct Held {
  Rigid3 prev_from_cur;
  Matrix6d share = Matrix6d::Identity();  ///< of the measurement
  Matrix6d added = Matrix6d::Zero();      ///< covariance of the rest
};

/// The measurement, its position by the hold as far as that is the surer one (Kalman's update).
Held hold_position(const Rigid3& measured,
                   const Matrix6d& noise,
                   const std::optional<MotionModel::Hold>& hold) {
  Held held{.prev_from_cur = measured};
  if (hold.has_value()) {
    const Eigen::Matrix3d of_hold = hold->sigma * hold->sigma * Eigen::Matrix3d::Identity();
    const Eigen::Matrix<double, 6, 3> gain =
        noise.leftCols<3>() * (noise.topLeftCorner<3, 3>() + of_hold).inverse();
    held.prev_from_cur = measured * motion_of(gain * (measured.inverse() * hold->at));
    held.share.leftCols<3>() -= gain;
    held.added = gain * of_hold * gain.transpose();
  }
  return held;
}

}  // namespace

void Persistence::add(const Eigen::Vector3d& velocity, double interval_s) {
  for (Sample& sample : recent_) {
    sample.age_s += interval_s;
  }
  while (recent_.size() > 1 && recent_[1].age_s >= kFades_s) {
    recent_.pop_front();
  }
  if (!recent_.empty() && recent_.front().age_s >= kFades_s) {
    const Eigen::Vector3d& before = recent_.front().velocity;
    const double kept = std::exp(-interval_s / kMemory_s);
    common_ = kept * common_ + interval_s * velocity.dot(before);
    square_ = kept * square_ + 0.5 * interval_s * (velocity.squaredNorm() + before.squaredNorm());
  }
  recent_.push_back({0.0, velocity});
}

double Persistence::share_after(double unmeasured_s) const {
  const double at = std::clamp((unmeasured_s - kBegins_s) / (kFades_s - kBegins_s), 0.0, 1.0);
  const double fresh = 0.5 * (1.0 + std::cos(at * std::numbers::pi));
  const double lasting = square_ > 0.0 ? std::clamp(common_ / square_, 0.0, 1.0) : 0.0;
  return fresh + (1.0 - fresh) * std::pow(lasting, std::max(unmeasured_s, kFades_s));
}

Rigid3 MotionModel::predict(double interval_s,
                            const std::optional<Eigen::Quaterniond>& turned) const {
  Rigid3 motion = motion_of(interval_s * velocity_ - faded(interval_s));
  motion.rotation = turned.value_or(motion.rotation);
  return motion;
}

Vector6d MotionModel::faded(double interval_s) const {
  const double middle_s = unmeasured_s_ > 0.0 ? unmeasured_s_ + 0.5 * interval_s : 0.0;
  Vector6d share;
  share << Eigen::Vector3d::Constant(1.0 - lasting_way_.share_after(middle_s)),
      Eigen::Vector3d::Constant(1.0 - lasting_turn_.share_after(middle_s));
  return interval_s * share.cwiseProduct(velocity_);
}

MotionModel::Fused MotionModel::fuse(const Rigid3& measured,
                                     const Matrix6d& of_measured,
                                     double weight,
                                     double interval_s,
                                     const std::optional<Hold>& hold) {
  const double t = interval_s;
  const Held held = hold_position(measured, of_measured, hold);
  const Matrix6d noise = held.share * of_measured * held.share.transpose() + held.added;
  if (!is_fused_) {  // the velocity is the difference of two poses
    covariance_ << noise, noise / t, noise / t, 2.0 / (t * t) * noise;
  }
  // The prediction's error; pushes come on top.
  Matrix12d step = Matrix12d::Identity();
  step.topRightCorner<6, 6>().diagonal().setConstant(t);
  covariance_ = step * covariance_ * step.transpose();
  const Rigid3 predicted = predict(t);
  const Vector6d off = six_of(predicted.inverse() * held.prev_from_cur);
  learn(off, noise, t);
  Vector6d diagonal;
  diagonal << Eigen::Vector3d::Constant(pushes_[0]), Eigen::Vector3d::Constant(pushes_[1]);
  const Matrix6d push = diagonal.cwiseMax(0.0).asDiagonal();
  const Matrix6d expected = t * t * covariance_.bottomRightCorner<6, 6>() + t * t * t / 3.0 * push;
  Matrix12d pushed;
  pushed << t * t * t / 3.0 * push, t * t / 2.0 * push, t * t / 2.0 * push, t * push;
  covariance_ += pushed;

  using Matrix126d = Eigen::Matrix<double, 12, 6>;
  Matrix126d at_weight_0;
  at_weight_0 << Matrix6d::Identity(), Matrix6d::Identity() / t;
  const Matrix6d sum = covariance_.topLeftCorner<6, 6>() + noise;
  const Matrix126d gain =
      (1.0 - weight) * at_weight_0 + weight * (covariance_.leftCols<6>() * sum.inverse());
  Matrix12d left = Matrix12d::Identity();
  left.leftCols<6>() -= gain;
  covariance_ = left * covariance_ * left.transpose() + gain * noise * gain.transpose();
  Fused fused;
  const Matrix6d of_pose = gain.topRows<6>();
  fused.prev_from_cur = predicted * motion_of(of_pose * off);
  fused.gain = of_pose * held.share;
  const Matrix6d of_prediction = Matrix6d::Identity() - of_pose;
  fused.rest = of_prediction * expected * of_prediction.transpose() +
               of_pose * held.added * of_pose.transpose();
  velocity_ += gain.bottomRows<6>() * off;
  is_fused_ = true;
  return fused;
}

/// The push is the rest of a prediction's error after its own and the measurement's.
void MotionModel::learn(const Vector6d& off, const Matrix6d& noise, double interval_s) {
  const Vector6d expected = (covariance_.topLeftCorner<6, 6>() + noise).diagonal();
  const double to_push = 3.0 / (interval_s * interval_s * interval_s);
  learnt_s_ = std::min(learnt_s_ + interval_s, std::max(kLearns_s, interval_s));
  for (const int k : {0, 1}) {
    const double square = off.segment<3>(3 * k).squaredNorm() / 3.0;
    const double mean = expected.segment<3>(3 * k).mean();
    const double push = to_push * (square - mean);
    pushes_[k] += interval_s / learnt_s_ * (push - pushes_[k]);
    if (square > kPushed * kPushed * mean) {
      pushes_[k] = std::max(pushes_[k], push);
    }
  }
}

void MotionModel::measured(const Rigid3& prev_from_cur, double interval_s, bool is_fused) {
  if (!is_fused) {
    velocity_ = six_of(prev_from_cur) / interval_s;
  }
  is_fused_ = is_fused;
  lasting_way_.add(velocity_.head<3>(), interval_s);
  lasting_turn_.add(velocity_.tail<3>(), interval_s);
  unmeasured_s_ = 0.0;
}

void MotionModel::rescale(double factor) {
  velocity_.head<3>() *= factor;
  lasting_way_.rescale(factor);
  pushes_[0] *= factor * factor;
  Eigen::Matrix<double, 12, 1> lengths = Eigen::Matrix<double, 12, 1>::Ones();
  lengths.head<3>().setConstant(factor);
  lengths.segment<3>(6).setConstant(factor);
  covariance_ = lengths.asDiagonal() * covariance_ * lengths.asDiagonal();
}

}  // namespace stemvo
