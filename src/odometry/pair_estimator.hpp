// SPDX-License-Identifier: MIT
#pragma once

#include <vector>

#include <Eigen/Core>

#include "odometry/estimator.hpp"
#include "odometry/metric_scale.hpp"
#include "odometry/two_view_estimator.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/options.hpp"

namespace stemvo {

/// Chains two-frame motions into poses: gate, step length, composition (paper eq. (11) and (12)).
class MotionChain {
 public:
  MotionChain(const OdometryOptions& odometry, const ScaleOptions& scale)
      : options_(odometry), assumed_step_(assumed_step(scale)) {}

  /// A measured motion from the last image to this one, and its length where it is known (0: it is
  /// not). Returns the state after the gate.
  FrameState add(const MeasuredMotion& motion, double length = 0.0);
  /// A frame without an image, or without a motion: the last motion goes on. With an image the next
  /// motion starts here, without one it starts at the last image.
  void extrapolate(bool has_image);
  /// The next motion starts at an earlier image, `num_frames` before the next frame.
  void go_back(const Rigid3& world_from_image, int num_frames) {
    world_from_image_ = world_from_image;
    frames_since_image_ = num_frames - 1;
  }

  [[nodiscard]] const Rigid3& world_from_camera() const { return world_from_camera_; }
  /// True until a first motion was accepted: decisive by the point test.
  [[nodiscard]] bool is_initializing() const { return is_initializing_; }

 private:
  [[nodiscard]] bool passes_gate(const Eigen::Vector3d& direction_in_prev,
                                 const MeasuredMotion& motion) const;
  void apply(const Rigid3& prev_from_cur, double length);

  OdometryOptions options_;
  double assumed_step_;        ///< metres or units, per frame
  Rigid3 world_from_image_;    ///< pose of the last image, where the matches start
  Rigid3 world_from_camera_;   ///< pose of the last frame
  Rigid3 last_prev_from_cur_;  ///< last motion of one frame; for extrapolation
  Eigen::Vector3d last_direction_ = Eigen::Vector3d::UnitZ();  ///< of travel, in the camera
  int frames_since_image_ = 0;
  bool is_initializing_ = true;
};

/// The paper's chain (`odometry.mode: two_frame`): motions between consecutive frames, composed.
class PairEstimator final : public Estimator {
 public:
  PairEstimator(const Options& config, const Camera& camera);

  [[nodiscard]] LocalizedFrame localize(const Frame& frame) override;
  void optimize(const Frame& frame, LocalizedFrame& localized) override;

  [[nodiscard]] const std::vector<Rigid3>& trajectory() const override { return trajectory_; }

 private:
  [[nodiscard]] double measure_length(const Frame& frame);

  Camera camera_;
  TwoViewEstimator two_view_;
  MotionChain chain_;
  MetricScale scale_;
  double last_step_;       ///< of one frame that was tracked; its length is the unit
  int last_image_ = -1;    ///< number of the last frame that had one
  MeasuredMotion motion_;  ///< of the frame in work
  std::vector<Rigid3> trajectory_;
};

}  // namespace stemvo
