// SPDX-License-Identifier: MIT
#include "odometry/map_placement.hpp"

#include "odometry/robust_models.hpp"

namespace stemvo {
namespace {

int count_agreeing(const SeenLandmarks& seen,
                   const Rigid3& camera_from_world,
                   const Camera& camera,
                   double bound_px) {
  int count = 0;
  for (std::size_t i = 0; i < seen.points.size(); ++i) {
    const Eigen::Vector3d x = camera_from_world * seen.points[i];
    count += x.z() > 0.0 && (camera.project(x) - seen.uv[i]).norm() <= bound_px ? 1 : 0;
  }
  return count;
}

}  // namespace

SeenLandmarks find_seen_landmarks(const LocalMap& map,
                                  const Matches& matches,
                                  const std::vector<char>& is_inlier) {
  SeenLandmarks seen;
  for (std::size_t i = 0; i < matches.cur_uv.size(); ++i) {
    const auto landmark = map.landmarks.find(matches.track_ids[i]);
    if (landmark != map.landmarks.end()) {
      seen.points.push_back(landmark->second);
      seen.uv.push_back(matches.cur_uv[i]);
      seen.is_inlier.push_back(is_inlier[i]);
    }
  }
  return seen;
}

std::optional<Placement> place_from_guess(const SeenLandmarks& seen,
                                          const Rigid3& world_from_camera,
                                          const Camera& camera,
                                          const PlacementOptions& options) {
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector2d> uv;
  for (std::size_t i = 0; i < seen.points.size(); ++i) {
    if (seen.is_inlier[i] != 0) {
      points.push_back(seen.points[i]);
      uv.push_back(seen.uv[i]);
    }
  }
  if (static_cast<int>(points.size()) < options.min_landmarks) {
    return std::nullopt;
  }
  const AbsolutePose pose =
      refine_absolute_pose(world_from_camera.inverse(), points, uv, camera, options.pose);
  if (pose.num_inliers < options.min_landmarks) {
    return std::nullopt;
  }
  return Placement{
      pose.camera_from_world.inverse(),
      count_agreeing(seen, pose.camera_from_world, camera, options.pose.inlier_bound_px)};
}

std::optional<Placement> place_by_search(const SeenLandmarks& seen,
                                         const Camera& camera,
                                         const PlacementOptions& options) {
  if (seen.size() < options.min_landmarks) {
    return std::nullopt;
  }
  const std::optional<Rigid3> start = estimate_absolute_pose(
      seen.points, seen.uv, camera, options.pose.inlier_bound_px, options.seed);
  if (!start.has_value()) {
    return std::nullopt;
  }
  const AbsolutePose pose =
      refine_absolute_pose(*start, seen.points, seen.uv, camera, options.pose);
  if (pose.num_inliers < options.min_landmarks) {
    return std::nullopt;
  }
  return Placement{pose.camera_from_world.inverse(), pose.num_inliers};
}

}  // namespace stemvo
