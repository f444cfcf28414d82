// SPDX-License-Identifier: MIT
#pragma once

#include <limits>
#include <optional>

#include <Eigen/Core>

#include "odometry/estimator.hpp"
#include "odometry/metric_scale.hpp"
#include "odometry/motion_covariance.hpp"
#include "odometry/two_view_estimator.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/options.hpp"

namespace stemvo {

/// Chains two-frame motions into poses: gate, step length, composition (paper eq. (11) and (12)).
class MotionChain {
 public:
  MotionChain(const OdometryOptions& odometry, const ScaleOptions& scale)
      : options_(odometry), assumed_step_(assumed_step(scale)) {}

  /// A frame's time, before it is given; the first one's is that of the pose at the origin.
  /// `turned`: its rotation since the frame before, for extrapolation; else that goes on.
  void advance_to(double time_s, const std::optional<Eigen::Quaterniond>& turned = {}) {
    turned_ = turned;
    if (std::isnan(time_s_)) {
      image_time_s_ = time_s;
    } else {
      interval_s_ = time_s - time_s_;
      assumed_speed_ = assumed_speed_ > 0.0 ? assumed_speed_ : assumed_step_ / interval_s_;
    }
    time_s_ = time_s;
  }
  /// A measured motion from the last image to this one, and its length where it is known (0: it is
  /// not). Returns the state after the gate.
  FrameState add(const MeasuredMotion& motion, double length = 0.0);
  /// A frame without an image, or without a motion: the last motion goes on. With an image the next
  /// motion starts here, without one it starts at the last image.
  void extrapolate(bool has_image) {
    world_from_camera_ =
        world_from_camera_ *
        Rigid3(turned_.value_or(so3_exp(interval_s_ * rad_per_s_)), interval_s_ * units_per_s_);
    if (has_image) {
      world_from_image_ = world_from_camera_;
      image_time_s_ = time_s_;
    }
  }
  /// The next motion starts at an earlier image.
  void go_back(const Rigid3& world_from_image, double image_time_s) {
    world_from_image_ = world_from_image;
    image_time_s_ = image_time_s;
  }
  [[nodiscard]] double since_image_s() const { return time_s_ - image_time_s_; }
  /// The speed of a motion that nothing measures, units or metres per second; 0 before the second
  /// frame.
  [[nodiscard]] double assumed_speed() const { return assumed_speed_; }

  [[nodiscard]] const Rigid3& world_from_camera() const { return world_from_camera_; }
  /// True until a first motion was accepted: decisive by the point test.
  [[nodiscard]] bool is_initializing() const { return is_initializing_; }

 private:
  void apply(const Rigid3& prev_from_cur, double length) {
    const Eigen::Vector3d step_in_prev = length * prev_from_cur.translation;
    const Eigen::Vector3d position =
        world_from_image_.translation + world_from_image_.rotation * step_in_prev;
    const Eigen::Quaterniond rotation = options_.composition == Composition::kPaper
                                            ? prev_from_cur.rotation * world_from_image_.rotation
                                            : world_from_image_.rotation * prev_from_cur.rotation;
    rad_per_s_ = so3_log(prev_from_cur.rotation) / since_image_s();
    units_per_s_ = step_in_prev / since_image_s();
    world_from_image_ = {rotation, position};
    world_from_camera_ = world_from_image_;
    image_time_s_ = time_s_;
  }

  OdometryOptions options_;
  double assumed_step_;  ///< metres or units, in the first interval
  double assumed_speed_ = 0.0;
  double time_s_ = std::numeric_limits<double>::quiet_NaN();  ///< of the frame in work
  double interval_s_ = 0.0;                                   ///< since the frame before
  double image_time_s_ = 0.0;
  std::optional<Eigen::Quaterniond> turned_;
  Rigid3 world_from_image_;   ///< pose of the last image, where the matches start
  Rigid3 world_from_camera_;  ///< pose of the last frame
  // The last motion, for extrapolation.
  Eigen::Vector3d rad_per_s_ = Eigen::Vector3d::Zero();  ///< a rotation vector
  Eigen::Vector3d units_per_s_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d last_direction_ = Eigen::Vector3d::UnitZ();  ///< of travel, in the camera
  bool is_initializing_ = true;
};

/// The paper's chain (`odometry.mode: two_frame`): motions between consecutive frames, composed.
class PairEstimator final : public Estimator {
 public:
  PairEstimator(const Options& config, const Camera& camera);

  [[nodiscard]] LocalizedFrame localize(const Frame& frame) override;
  void optimize(const Frame& frame, LocalizedFrame& localized) override;

 private:
  [[nodiscard]] double measure_length(const Frame& frame);

  OdometryOptions options_;
  Camera camera_;
  MotionCovariance uncertainty_;
  TwoViewEstimator two_view_;
  MotionChain chain_;
  HintTrust trust_;
  MetricScale scale_;
  double last_speed_ = 0.0;  ///< of the last frame that was tracked: its unit; 0: none yet
  int last_image_ = -1;      ///< number of the last frame that had one
  MeasuredMotion motion_;    ///< of the frame in work
};

}  // namespace stemvo
