// SPDX-License-Identifier: MIT
#include "odometry/window.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "geometry/triangulation.hpp"

namespace stemvo {
namespace {

struct Observation {
  const Keyframe* keyframe;
  const Eigen::Vector2d* uv;
};

std::vector<Observation> observations_of(const Window& window, int track_id) {
  std::vector<Observation> observations;
  for (const Keyframe& keyframe : window.keyframes) {
    if (const TrackPoint* point = find_point(keyframe.points, track_id)) {
      observations.push_back({&keyframe, &point->uv});
    }
  }
  return observations;
}

bool is_seen_well(const Eigen::Vector3d& point_in_world,
                  const std::vector<Observation>& observations,
                  const Camera& camera,
                  double bound_px) {
  return std::all_of(observations.begin(), observations.end(), [&](const Observation& seen) {
    return is_near(seen.keyframe->world_from_camera.inverse(), point_in_world, *seen.uv, camera,
                   bound_px);
  });
}

std::optional<Eigen::Vector3d> triangulate_track(const std::vector<Observation>& observations,
                                                 const Camera& camera,
                                                 const WindowOptions& options) {
  if (observations.size() < 2) {
    return std::nullopt;
  }
  const Observation& first = observations.front();
  const Observation& last = observations.back();
  const Rigid3 last_from_first =
      last.keyframe->world_from_camera.inverse() * first.keyframe->world_from_camera;
  const TriangulatedPoint point =
      triangulate(last_from_first, camera.normalize(*first.uv), camera.normalize(*last.uv));
  const double max_cos = std::cos(options.min_parallax_deg * std::numbers::pi / 180.0);
  if (!point.finite || !(point.cos_parallax < max_cos)) {
    return std::nullopt;
  }
  const Eigen::Vector3d in_world = first.keyframe->world_from_camera * point.in_prev;
  return is_seen_well(in_world, observations, camera, options.max_reprojection_error_px)
             ? std::optional(in_world)
             : std::nullopt;
}

}  // namespace

void add_keyframe(Window& window, Keyframe keyframe, const WindowOptions& options) {
  window.keyframes.push_back(std::move(keyframe));
  while (static_cast<int>(window.keyframes.size()) > options.num_keyframes) {
    window.keyframes.pop_front();
  }
  std::erase_if(window.landmarks, [&](const auto& landmark) {
    return std::none_of(window.keyframes.rbegin(), window.keyframes.rend(),
                        [&](const Keyframe& seen_from) {
                          return find_point(seen_from.points, landmark.first) != nullptr;
                        });
  });
}

void triangulate_landmarks(Window& window, const Camera& camera, const WindowOptions& options) {
  if (window.keyframes.size() < 2) {
    return;
  }
  for (const TrackPoint& point : window.keyframes.back().points) {
    if (window.landmarks.contains(point.track_id)) {
      continue;
    }
    if (const auto landmark =
            triangulate_track(observations_of(window, point.track_id), camera, options)) {
      window.landmarks.emplace(point.track_id, *landmark);
    }
  }
}

void cull_landmarks(Window& window, const Camera& camera, const WindowOptions& options) {
  std::erase_if(window.landmarks, [&](const auto& landmark) {
    const auto& [track_id, point_in_world] = landmark;
    return !is_seen_well(point_in_world, observations_of(window, track_id), camera,
                         options.max_reprojection_error_px);
  });
}

void rescale(Window& window, double factor, const Eigen::Vector3d& center) {
  const auto scaled = [&](const Eigen::Vector3d& point) -> Eigen::Vector3d {
    return center + factor * (point - center);
  };
  for (Keyframe& keyframe : window.keyframes) {
    keyframe.world_from_camera.translation = scaled(keyframe.world_from_camera.translation);
    for (FrameBetween& follower : keyframe.followers) {
      follower.keyframe_from_camera.translation *= factor;
    }
  }
  for (auto& [track_id, point] : window.landmarks) {
    point = scaled(point);
  }
}

}  // namespace stemvo
