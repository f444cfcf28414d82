// SPDX-License-Identifier: MIT
#include "odometry/road_landmarks.hpp"

#include <span>

namespace stemvo {
namespace {

constexpr std::size_t kMinKeyframes = 3;
constexpr double kTrack_px = 0.7;  ///< error of a track over the window

}  // namespace

std::vector<RoadLandmark> road_landmarks(const Window& window,
                                         const Rigid3& world_from_camera,
                                         const Observations& seen,
                                         const Camera& camera) {
  std::vector<RoadLandmark> result;
  const Rigid3 camera_from_world = world_from_camera.inverse();
  ObservationWalk walk(window);
  for (const Observation& point : seen) {
    const auto landmark = window.landmarks.find(point.track_id);
    if (landmark == window.landmarks.end()) {
      continue;
    }
    const Eigen::Vector3d here = camera_from_world * landmark->second;
    const std::span<const KeyframeObservation> views = walk.seek(point.track_id);
    if (!(here.z() > 0.0) || views.size() < kMinKeyframes) {
      continue;
    }
    const Eigen::Vector3d first =
        camera_from_world * window.keyframes[views.front().keyframe].world_from_camera.translation;
    // The sine of the parallax between the first view and this one.
    const double parallax = first.cross(here.normalized()).norm() / (here - first).norm();
    if (parallax > 0.0) {
      result.push_back({here, kTrack_px / (camera.mean_focal_px() * parallax)});
    }
  }
  return result;
}

}  // namespace stemvo
