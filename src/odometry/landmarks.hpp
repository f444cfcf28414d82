// SPDX-License-Identifier: MIT
#pragma once

#include "odometry/window.hpp"
#include "stemvo/geometry/camera.hpp"

namespace stemvo {

/// Triangulates the tracks of the newest keyframe that are no landmarks yet, from the first and the
/// last keyframe that see them. Kept are points with enough parallax, in front of every keyframe
/// that sees them and reprojected well in each.
void triangulate_landmarks(Window& window, const Camera& camera, const WindowOptions& options);

/// Drops landmarks that a keyframe sees from behind or too far from their observation.
void cull_landmarks(Window& window, const Camera& camera, const WindowOptions& options);

}  // namespace stemvo
