// SPDX-License-Identifier: MIT
#include "odometry/localization.hpp"

#include <algorithm>
#include <cstddef>
#include <limits>

#include "geometry/median.hpp"
#include "geometry/pose_refinement.hpp"
#include "odometry/robust_models.hpp"
#include "odometry/tracks.hpp"

namespace stemvo {
namespace {

constexpr std::size_t kMinTurnLandmarks = 10;

std::optional<Localization> optimize_pose(const SeenLandmarks& seen,
                                          const Rigid3& start_camera_from_world,
                                          const Camera& camera,
                                          const LocalizationOptions& options) {
  const Rigid3 first = refine_absolute_pose(start_camera_from_world, seen.points, seen.uv, camera,
                                            {.loss_scale_px = options.first_loss_px});
  std::vector<char> mask;
  for (const double distance_px : distances_px(seen, first, camera)) {
    mask.push_back(distance_px <= 2.0 * options.inlier_bound_px ? 1 : 0);
  }
  const SeenLandmarks near = select(seen, mask);
  if (near.size() < options.min_landmarks) {
    return std::nullopt;
  }
  const Rigid3 second =
      refine_absolute_pose(first, near.points, near.uv, camera, {.loss_scale_px = options.loss_px});
  const auto count = [&](const SeenLandmarks& landmarks) {
    const std::vector<double> distances = distances_px(landmarks, second, camera);
    const auto is_inlier = [&](double px) { return px <= options.inlier_bound_px; };
    return static_cast<int>(std::ranges::count_if(distances, is_inlier));
  };
  if (count(near) < options.min_landmarks) {
    return std::nullopt;
  }
  return Localization{second.inverse(), count(seen)};
}

}  // namespace

SeenLandmarks select(const SeenLandmarks& seen, const std::vector<char>& mask) {
  return {select(seen.points, mask), select(seen.uv, mask), select(seen.track_ids, mask)};
}

SeenLandmarks find_seen_landmarks(const Window& window, const Observations& frame) {
  SeenLandmarks seen;
  for (const Observation& point : frame) {
    const auto landmark = window.landmarks.find(point.track_id);
    if (landmark != window.landmarks.end()) {
      seen.points.push_back(landmark->second);
      seen.uv.push_back(point.uv);
      seen.track_ids.push_back(point.track_id);
    }
  }
  return seen;
}

Observations project_lost_landmarks(const Window& window,
                                    const Rigid3& world_from_camera,
                                    const Observations& frame,
                                    const Camera& camera) {
  const Rigid3 camera_from_world = world_from_camera.inverse();
  Observations lost;
  for (const auto& [track_id, point_in_world] : window.landmarks) {
    const Eigen::Vector3d point = camera_from_world * point_in_world;
    if (point.z() > 0.0 && find_point(frame, track_id) == nullptr) {
      lost.push_back({track_id, camera.project(point)});
    }
  }
  return lost;
}

std::vector<double> distances_px(const SeenLandmarks& seen,
                                 const Rigid3& camera_from_world,
                                 const Camera& camera) {
  std::vector<double> distances;
  for (std::size_t i = 0; i < seen.points.size(); ++i) {
    const Eigen::Vector3d point = camera_from_world * seen.points[i];
    distances.push_back(point.z() > 0.0 ? (camera.project(point) - seen.uv[i]).norm()
                                        : std::numeric_limits<double>::infinity());
  }
  return distances;
}

Rigid3 nearer_pose(const Rigid3& first,
                   const Rigid3& second,
                   const SeenLandmarks& seen,
                   const Camera& camera) {
  const auto distance_px = [&](const Rigid3& world_from_camera) {
    return median(distances_px(seen, world_from_camera.inverse(), camera));
  };
  return distance_px(second) < distance_px(first) ? second : first;
}

std::optional<Localization> localize(const SeenLandmarks& seen,
                                     const Rigid3& predicted_world_from_camera,
                                     const Camera& camera,
                                     const LocalizationOptions& options) {
  if (seen.size() < options.min_landmarks) {
    return std::nullopt;
  }
  auto best = optimize_pose(seen, predicted_world_from_camera.inverse(), camera, options);
  const int num_inliers = best.has_value() ? best->num_inliers : 0;
  if (num_inliers >= options.min_agreement * seen.size()) {
    return best;
  }
  const std::optional<Rigid3> start =
      estimate_absolute_pose(seen.points, seen.uv, camera, options.inlier_bound_px, options.seed);
  if (start.has_value()) {
    const auto found = optimize_pose(seen, *start, camera, options);
    if (found.has_value() && found->num_inliers > num_inliers) {
      return found;
    }
  }
  return best;
}

std::optional<double> parallax_since_px(const Eigen::Vector3d& position,
                                        const Rigid3& world_from_camera,
                                        const SeenLandmarks& seen,
                                        const Camera& camera,
                                        double bound_px) {
  const Rigid3 camera_from_world = world_from_camera.inverse();
  const Rigid3 held(camera_from_world.rotation, -(camera_from_world.rotation * position));
  std::vector<Eigen::Vector2d> held_uv;
  std::vector<Eigen::Vector2d> moved_uv;
  for (std::size_t i = 0; i < seen.points.size(); ++i) {
    const Eigen::Vector3d in_held = held * seen.points[i];
    if (in_held.z() > 0.0 &&
        is_near(camera_from_world, seen.points[i], seen.uv[i], camera, bound_px)) {
      held_uv.push_back(camera.project(in_held));
      moved_uv.push_back(camera.project(camera_from_world * seen.points[i]));
    }
  }
  if (held_uv.size() < kMinTurnLandmarks) {
    return std::nullopt;
  }
  const PixelPairs moved(held_uv, moved_uv);
  const Eigen::Quaterniond turn =
      refine_rotation(Eigen::Quaterniond::Identity(), moved, camera, {.max_iterations = 5});
  return rms_parallax_px(turn, moved, camera);
}

}  // namespace stemvo
