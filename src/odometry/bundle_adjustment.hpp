// SPDX-License-Identifier: MIT
#pragma once

#include <optional>

#include <Eigen/Core>

#include "geometry/bundle.hpp"
#include "odometry/window.hpp"
#include "stemvo/camera.hpp"

namespace stemvo {

struct BundleAdjustmentOptions {
  /// The oldest. Two hold the gauge, scale included; with one the length of the window is kept,
  /// from the oldest keyframe to the last but one.
  int num_fixed_keyframes = 2;
  int max_iterations = 10;
  /// Cauchy scale on the reprojection error: at least this ..
  double loss_scale_px = 0.2;
  /// .. and so many times the median error: a lens or a shutter that the camera model does not know
  /// makes every observation worse.
  double loss_share = 2.0;
  int min_observations = 2;  ///< of a landmark that takes part
};

/// Sliding-window bundle adjustment: poses of the window and its landmarks, robust reprojection
/// error, Schur complement over the landmarks. One thread: the same bytes on every run. False: too
/// little to do, or not solved; the window is unchanged.
bool refine_window(Window& window, const Camera& camera, const BundleAdjustmentOptions& options);

/// The camera as a window tells it, all else left free.
struct CameraMeasurement {
  CameraChange change;            ///< of `camera`
  CameraInformation information;  ///< of it alone, without the prior
};
[[nodiscard]] std::optional<CameraMeasurement> measure_camera(
    const Window& window,
    const Camera& camera,
    const CameraPrior& prior,
    const BundleAdjustmentOptions& options);

}  // namespace stemvo
