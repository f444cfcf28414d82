// SPDX-License-Identifier: MIT
#pragma once

#include <optional>

#include <Eigen/Core>

#include "odometry/localization.hpp"
#include "odometry/track_points.hpp"
#include "stemvo/geometry/camera.hpp"
#include "stemvo/geometry/rigid3.hpp"

namespace stemvo {

/// The tracks stay where they were: their median flow is less than `min_flow_px`. False where the
/// two share fewer than `min_tracks`.
[[nodiscard]] bool is_stationary(const TrackPoints& before,
                                 const TrackPoints& now,
                                 double min_flow_px,
                                 int min_tracks);

/// world_from_camera with the position held, if it explains the image too: the way from there to
/// the frame's own position moves its landmarks in the image by less than `min_flow_px` (root mean
/// square, pixels), once a rotation has done what it can. nullopt: it moved, or too few landmarks
/// are within `bound_px` to tell.
[[nodiscard]] std::optional<Rigid3> turned_pose(const Rigid3& world_from_camera,
                                                const Eigen::Vector3d& held_position,
                                                const SeenLandmarks& seen,
                                                const Camera& camera,
                                                double min_flow_px,
                                                double bound_px);

}  // namespace stemvo
