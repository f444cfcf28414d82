// SPDX-License-Identifier: MIT
#pragma once

#include <vector>

#include "odometry/road/belief.hpp"
#include "odometry/window.hpp"
#include "stemvo/camera.hpp"

namespace stemvo {

/// The window's landmarks that a frame sees, as witnesses of the road: those in front of the camera
/// that at least three keyframes see, which a wrong track seldom survives.
[[nodiscard]] std::vector<RoadLandmark> road_landmarks(const Window& window,
                                                       const Rigid3& world_from_camera,
                                                       const Observations& seen,
                                                       const Camera& camera);

}  // namespace stemvo
