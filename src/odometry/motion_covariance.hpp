// SPDX-License-Identifier: MIT
#pragma once

#include <deque>
#include <optional>

#include "geometry/pose_influence.hpp"
#include "odometry/metric_scale.hpp"
#include "odometry/motion_model.hpp"
#include "odometry/window.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/frame_result.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// The scale's sigma where lengths are metres, nullopt where they are units.
[[nodiscard]] inline std::optional<double> metric_sigma(const FrameResult& result) {
  return has_metres(result) ? result.scale_sigma : std::nullopt;
}

/// How sure the motion from frame to frame is (FrameResult::motion_covariance), measured on the
/// drive itself: no noise is assumed. Its terms:
/// - Tracks: how far each moves the pose before and this one, as a difference, so that what both
///   frames share cancels (a patch's own error, its landmark's).
/// - The map: what an adjustment at a keyframe moves was an error until then.
/// - A motion model's share of the pose: what it expects to be wrong.
/// - A pose that goes on unmeasured: how much velocities changed over as long a time, and the speed
///   that was let go.
/// - The camera's principal point; the scale.
class MotionCovariance {
 public:
  /// A frame's motion as the estimator knows it.
  struct Motion {
    FrameState state = FrameState::kFirst;
    bool is_localized = false;  ///< the pose was measured where later ones are
    Rigid3 prev_from_cur;       ///< between the poses as they are returned
    double dt_s = 0.0;
    double usual_step = 1.0;  ///< length of a motion of which nothing else is known
    double hidden_px = 0.0;   ///< less flow counts as none
    std::optional<MotionModel::Fused> fused = std::nullopt;
    Vector6d faded = Vector6d::Zero();  ///< MotionModel::faded where nothing was measured
    /// By two views instead of the map: covariance for a translation of length 1.
    std::optional<Matrix6d> two_view;
    Camera camera;
    std::optional<CameraSigma> camera_sigma;
    std::optional<double> scale_sigma;  ///< nullopt: the path is in units
  };

  /// A frame and the one before in the map.
  struct InMap {
    const Window& window;
    const Rigid3& world_from_camera;
    const Rigid3& world_from_prev;
    const Camera& camera;
    double loss_px;
  };
  /// Before the frame's keyframe changes the map; and after, where it did.
  void localized(const InMap& at, const Observations& points);
  void adjusted(const InMap& at);

  /// Last, for every frame. Finite, symmetric, positive definite; zero up to the first one seen.
  [[nodiscard]] Matrix6d finish(const Motion& motion);
  /// The map was multiplied by `factor` (new units = factor * old units).
  void rescale(double factor);

 private:
  [[nodiscard]] Matrix6d change_of_velocity(const Motion& motion) const;
  [[nodiscard]] Matrix6d map_term(FrameState state);
  void learn(const Motion& motion);

  bool has_begun_ = false;  ///< a frame was seen

  // The frame before.
  Observations prev_points_;
  bool is_prev_localized_ = false;         ///< its pose was measured in the map
  Matrix6d prev_pose_ = Matrix6d::Zero();  ///< covariance of its pose in the map

  // The frame in work, where it is in the map.
  Observations points_;
  PoseInfluences influences_;
  std::optional<Matrix6d> track_noise_;  ///< of the motion between two tracked frames
  std::optional<Vector6d> step_;         ///< that an adjustment put between their poses

  Matrix6d mean_step_ = Matrix6d::Zero();  ///< squares, of the last adjustments
  int num_steps_ = 0;
  int frames_since_step_ = 0;
  struct Velocity {
    double time_s = 0.0;
    Vector6d per_s;
  };
  std::deque<Velocity> velocities_;  ///< of tracked frames of the last seconds
  double time_s_ = 0.0;
  double unmeasured_s_ = 0.0;          ///< since the last localized frame
  Vector6d faded_ = Vector6d::Zero();  ///< since then
};

}  // namespace stemvo
