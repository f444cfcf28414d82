// SPDX-License-Identifier: MIT
#pragma once

#include <optional>

#include <Eigen/Core>

#include "geometry/bundle.hpp"
#include "odometry/bundle_adjustment.hpp"
#include "odometry/window.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/options.hpp"

namespace stemvo {

/// Learns the camera from windows that share no keyframe, one after the other: principal point,
/// focal length and the radial distortion that is left, each with a prior. The given camera is left
/// only where the data insist.
class SelfCalibration {
 public:
  SelfCalibration(const Camera& given, CameraRefinement refinement);

  /// A window of full length, after each refinement; for measuring, one that shares a keyframe with
  /// the last one that was used is left out.
  void observe(const Window& window, const BundleAdjustmentOptions& options);

  /// The given one, or on its way to what the data insist on.
  [[nodiscard]] const Camera& camera() const { return camera_; }
  /// Of the estimate; nullopt: nothing is refined.
  [[nodiscard]] std::optional<Eigen::Vector2d> principal_point_sigma_px() const;

 private:
  void approach_believed();
  [[nodiscard]] CameraChange applied() const;
  [[nodiscard]] CameraChange sigma() const;

  Camera given_;
  Camera camera_;
  CameraRefinement refinement_;
  CameraChange believed_ = CameraChange::Zero();  ///< what the data insist on; camera_ goes there
  CameraChange mean_ = CameraChange::Zero();      ///< less the given camera
  CameraInformation information_;
  int newest_used_ = -1;  ///< frame of the newest keyframe that was used
};

}  // namespace stemvo
