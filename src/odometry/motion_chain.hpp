// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Core>

#include "odometry/frame_motion.hpp"
#include "odometry/two_view_estimator.hpp"
#include "stemvo/config.hpp"
#include "stemvo/geometry/rigid3.hpp"
#include "stemvo/odometry/odometry.hpp"

namespace stemvo {

/// Chains two-frame motions into poses: gate, step length, composition (paper eq. (11) and (12)).
class MotionChain {
 public:
  MotionChain(const OdometryOptions& odometry, const ScaleOptions& scale)
      : options_(odometry), assumed_step_(assumed_step(scale)) {}

  /// The frame of the first picture: the pose stays where it is.
  void start() { has_picture_ = true; }
  /// A measured motion from the last picture to this one. Returns the state after the gate.
  FrameState add(const MeasuredMotion& motion);
  /// A frame without a picture, or without a motion: the last motion goes on. With a picture the
  /// next motion starts here, without one it starts at the last picture.
  void extrapolate(bool has_picture);
  /// The next motion starts at an earlier picture, `num_frames` before the next frame.
  void go_back(const Rigid3& world_from_picture, int num_frames) {
    world_from_picture_ = world_from_picture;
    frames_since_picture_ = num_frames - 1;
  }

  [[nodiscard]] const Rigid3& world_from_camera() const { return world_from_camera_; }
  /// True until a first motion was accepted: decisive by the point test.
  [[nodiscard]] bool is_initializing() const { return is_initializing_; }
  [[nodiscard]] bool has_picture() const { return has_picture_; }

 private:
  [[nodiscard]] bool passes_gate(const Eigen::Vector3d& direction_in_prev,
                                 const MeasuredMotion& motion) const;
  void apply(const Rigid3& prev_from_cur, double step_m);

  OdometryOptions options_;
  double assumed_step_;        ///< metres or units, per frame
  Rigid3 world_from_picture_;  ///< pose of the last picture the matches start from
  Rigid3 world_from_camera_;   ///< pose of the last frame
  Rigid3 last_prev_from_cur_;  ///< last motion of one frame, metres; for extrapolation
  Eigen::Vector3d last_direction_ = Eigen::Vector3d::UnitZ();  ///< of travel, in the camera
  int frames_since_picture_ = 0;
  bool has_picture_ = false;
  bool is_initializing_ = true;
};

}  // namespace stemvo
