// SPDX-License-Identifier: MIT
#pragma once

#include <optional>

#include "geometry/bundle.hpp"
#include "odometry/window.hpp"
#include "stemvo/camera.hpp"

namespace stemvo {

/// Sliding-window bundle adjustment: poses of the window and its landmarks, robust reprojection
/// error, Schur complement over the landmarks. Two fixed keyframes (the oldest ones) hold the
/// gauge, scale included; with one the length of the window is kept, from the oldest keyframe to
/// the last but one. The loss scale is the options' or twice the median error, whichever is larger.
/// One thread: the same bytes on every run. False: too little to do, or not solved; the window is
/// unchanged.
bool refine_window(Window& window, const Camera& camera, const BundleOptions& options);

/// The camera as a window tells it, all else left free.
struct CameraMeasurement {
  IntrinsicsDelta change;         ///< of `camera`
  CameraInformation information;  ///< of it alone, without the prior
};
[[nodiscard]] std::optional<CameraMeasurement> measure_camera(const Window& window,
                                                              const Camera& camera,
                                                              const CameraPrior& prior,
                                                              const BundleOptions& options);

}  // namespace stemvo
