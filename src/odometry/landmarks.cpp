// SPDX-License-Identifier: MIT
#include "odometry/landmarks.hpp"

#include <cmath>
#include <numbers>
#include <optional>
#include <vector>

#include "stemvo/geometry/triangulation.hpp"

namespace stemvo {
namespace {

struct Sighting {
  const Keyframe* keyframe;
  const TrackPoint* observation;
};

std::vector<Sighting> views_of(const Window& window, int track_id) {
  std::vector<Sighting> views;
  for (const Keyframe& keyframe : window.keyframes) {
    if (const TrackPoint* observation = find_point(keyframe.points, track_id)) {
      views.push_back({&keyframe, observation});
    }
  }
  return views;
}

bool is_seen_well(const Eigen::Vector3d& point_in_world,
                  const Sighting& sighting,
                  const Camera& camera,
                  double bound_px) {
  return is_near(sighting.keyframe->world_from_camera.inverse(), point_in_world,
                 sighting.observation->uv, camera, bound_px);
}

std::optional<Eigen::Vector3d> triangulate_views(const std::vector<Sighting>& views,
                                                 const Camera& camera,
                                                 const WindowOptions& options) {
  const Sighting& first = views.front();
  const Sighting& last = views.back();
  const Rigid3 last_from_first =
      last.keyframe->world_from_camera.inverse() * first.keyframe->world_from_camera;
  const TriangulatedPoint point =
      triangulate(last_from_first, camera.normalize(first.observation->uv),
                  camera.normalize(last.observation->uv));
  const double max_cos = std::cos(options.min_parallax_deg * std::numbers::pi / 180.0);
  if (!point.finite || !(point.cos_parallax < max_cos)) {
    return std::nullopt;
  }
  const Eigen::Vector3d in_world = first.keyframe->world_from_camera * point.in_prev;
  for (const Sighting& view : views) {
    if (!is_seen_well(in_world, view, camera, options.max_reprojection_error_px)) {
      return std::nullopt;
    }
  }
  return in_world;
}

}  // namespace

void triangulate_landmarks(Window& window, const Camera& camera, const WindowOptions& options) {
  if (window.keyframes.size() < 2) {
    return;
  }
  for (const TrackPoint& observation : window.keyframes.back().points) {
    if (window.landmarks.contains(observation.track_id)) {
      continue;
    }
    const std::vector<Sighting> views = views_of(window, observation.track_id);
    if (views.size() < 2) {
      continue;
    }
    if (const auto point = triangulate_views(views, camera, options)) {
      window.landmarks.emplace(observation.track_id, *point);
    }
  }
}

void cull_landmarks(Window& window, const Camera& camera, const WindowOptions& options) {
  std::erase_if(window.landmarks, [&](const auto& landmark) {
    const auto& [track_id, point_in_world] = landmark;
    for (const Sighting& view : views_of(window, track_id)) {
      if (!is_seen_well(point_in_world, view, camera, options.max_reprojection_error_px)) {
        return true;
      }
    }
    return false;
  });
}

}  // namespace stemvo
