// SPDX-License-Identifier: MIT
#pragma once

#include <deque>
#include <optional>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "geometry/pose_influence.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// How long a drive's speed lasts: the share of it that is left a second later, mean over the last
/// seconds. None of it is believed to last before a second was seen.
class Persistence {
 public:
  void add(const Eigen::Vector3d& velocity, double interval_s);
  void restart() { recent_.clear(); }
  void rescale(double factor) {
    for (Sample& sample : recent_) {
      sample.velocity *= factor;
    }
    common_ *= factor * factor;
    square_ *= factor * factor;
  }
  /// The share that goes on so long after the last measurement; 1 at first.
  [[nodiscard]] double share_after(double unmeasured_s) const;

 private:
  struct Sample {
    double age_s = 0.0;
    Eigen::Vector3d velocity;
  };
  std::deque<Sample> recent_;  ///< of the last second, the oldest first
  double common_ = 0.0;        ///< products of velocities a second apart, and ..
  double square_ = 0.0;        ///< .. their squares
};

/// The expected motion of a camera: it goes on evenly, pushed by accelerations that are
/// white noise. Motions are prev_from_cur; six numbers are x y z, then the rotation, about the
/// camera's axes.
class MotionModel {
 public:
  /// A motion by the prediction and a measurement of it.
  struct Fused {
    Rigid3 prev_from_cur;
    Matrix6d gain = Matrix6d::Identity();  ///< the share of the measurement
    Matrix6d rest = Matrix6d::Zero();      ///< covariance by all that is not the measurement
  };
  /// A position that is known from elsewhere, in the camera before, with a sigma per axis.
  struct Hold {
    Eigen::Vector3d at;
    double sigma = 0.0;
  };

  /// The motion in so many seconds. `turned`: its rotation where that is known from elsewhere.
  /// Where the frames before were not measured, the speed fades as fast as it was seen to.
  [[nodiscard]] Rigid3 predict(double interval_s,
                               const std::optional<Eigen::Quaterniond>& turned = {}) const;
  /// The part of the last speed that predict() leaves out.
  [[nodiscard]] Vector6d faded(double interval_s) const;

  /// `noise`: covariance of what was measured. `weight`, 0 to 1, of the prediction; at 0 it has
  /// none, at 1 as much as both covariances say.
  [[nodiscard]] Fused fuse(const Rigid3& measured,
                           const Matrix6d& noise,
                           double weight,
                           double interval_s,
                           const std::optional<Hold>& hold = {});
  /// The motion of a frame that was measured is final; `is_fused`: by fuse().
  void measured(const Rigid3& prev_from_cur, double interval_s, bool is_fused);
  /// No motion was measured: the prediction was taken.
  void lost(double interval_s) {
    unmeasured_s_ += interval_s;
    is_fused_ = false;
    lasting_way_.restart();
    lasting_turn_.restart();
  }
  /// The next motion is not the one since the frame before.
  void restart() {
    lost(0.0);
    velocity_.setZero();
    unmeasured_s_ = 0.0;
  }
  /// Lengths were multiplied.
  void rescale(double factor);
  [[nodiscard]] double speed() const { return velocity_.head<3>().norm(); }

 private:
  using Matrix12d = Eigen::Matrix<double, 12, 12>;
  void learn(const Vector6d& off, const Matrix6d& noise, double interval_s);

  Vector6d velocity_ = Vector6d::Zero();  ///< per second
  double unmeasured_s_ = 0.0;
  Persistence lasting_way_;
  Persistence lasting_turn_;
  bool is_fused_ = false;                     ///< the last frame was
  Matrix12d covariance_ = Matrix12d::Zero();  ///< then: of its pose and velocity
  Eigen::Vector2d pushes_ = {0.0, 0.0};       ///< changes of velocity, squares per second
  double learnt_s_ = 0.0;
};

}  // namespace stemvo
