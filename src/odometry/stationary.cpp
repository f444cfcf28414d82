// SPDX-License-Identifier: MIT
#include "odometry/stationary.hpp"

#include <vector>

#include "odometry/parallax.hpp"
#include "stemvo/geometry/relative_pose_refinement.hpp"

namespace stemvo {
namespace {

constexpr std::size_t kMinLandmarks = 10;

using Points = std::vector<Eigen::Vector2d>;

Eigen::Quaterniond rotation_between(const Points& prev_uv,
                                    const Points& cur_uv,
                                    const Camera& camera) {
  return refine_rotation({}, prev_uv, cur_uv, camera, {.max_iterations = 5}).cur_from_prev.rotation;
}

}  // namespace

bool is_stationary(const TrackPoints& before,
                   const TrackPoints& now,
                   double min_flow_px,
                   int min_tracks) {
  const PointPairs pairs = common_points(before, now);
  return pairs.size() >= min_tracks && median_flow_px(pairs.prev_uv, pairs.cur_uv) < min_flow_px;
}

std::optional<Rigid3> turned_pose(const Rigid3& world_from_camera,
                                  const Eigen::Vector3d& held_position,
                                  const SeenLandmarks& seen,
                                  const Camera& camera,
                                  double min_flow_px,
                                  double bound_px) {
  const Rigid3 camera_from_world = world_from_camera.inverse();
  const Rigid3 held(camera_from_world.rotation, -(camera_from_world.rotation * held_position));
  Points held_uv;
  Points moved_uv;
  Points seen_uv;
  for (std::size_t i = 0; i < seen.points.size(); ++i) {
    const Eigen::Vector3d in_held = held * seen.points[i];
    if (in_held.z() > 0.0 &&
        is_near(camera_from_world, seen.points[i], seen.uv[i], camera, bound_px)) {
      held_uv.push_back(camera.project(in_held));
      moved_uv.push_back(camera.project(camera_from_world * seen.points[i]));
      seen_uv.push_back(seen.uv[i]);
    }
  }
  if (held_uv.size() < kMinLandmarks) {
    return std::nullopt;
  }
  const Eigen::Quaterniond turn = rotation_between(held_uv, moved_uv, camera);
  if (rms_parallax_px(turn, held_uv, moved_uv, camera) >= min_flow_px) {
    return std::nullopt;
  }
  const Eigen::Quaterniond turned = rotation_between(held_uv, seen_uv, camera) * held.rotation;
  return Rigid3(turned.conjugate(), held_position);
}

}  // namespace stemvo
