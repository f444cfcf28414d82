// SPDX-License-Identifier: MIT
#include "odometry/window.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>

#include "geometry/triangulation.hpp"

namespace stemvo {
namespace {

/// Tracks that the oldest keyframe and the one that comes must share for it to stay.
constexpr int kMinConnection = 20;
/// The last keyframes, which stay, the coming one among them.
constexpr std::size_t kNumRecent = 4;

bool is_seen_well(const Eigen::Vector3d& point_in_world,
                  std::span<const KeyframeObservation> observations,
                  const std::vector<Rigid3>& poses,
                  const Camera& camera,
                  double bound_px) {
  return std::all_of(
      observations.begin(), observations.end(), [&](const KeyframeObservation& seen) {
        return is_near(poses[seen.keyframe], point_in_world, seen.uv, camera, bound_px);
      });
}

std::optional<Eigen::Vector3d> triangulate_track(const Window& window,
                                                 std::span<const KeyframeObservation> observations,
                                                 const std::vector<Rigid3>& poses,
                                                 const Camera& camera,
                                                 const WindowOptions& options) {
  if (observations.size() < 2) {
    return std::nullopt;
  }
  const KeyframeObservation& first = observations.front();
  const KeyframeObservation& last = observations.back();
  const Rigid3& world_from_first = window.keyframes[first.keyframe].world_from_camera;
  const TriangulatedPoint point =
      triangulate(poses[last.keyframe] * world_from_first, camera.normalize(first.uv),
                  camera.normalize(last.uv));
  const double max_cos = std::cos(options.min_parallax_deg * std::numbers::pi / 180.0);
  if (!point.finite || !(point.cos_parallax < max_cos)) {
    return std::nullopt;
  }
  const Eigen::Vector3d in_world = world_from_first * point.in_prev;
  return is_seen_well(in_world, observations, poses, camera, options.max_reprojection_error_px)
             ? std::optional(in_world)
             : std::nullopt;
}

}  // namespace

ObservationWalk::ObservationWalk(const Window& window) : window_(window) {
  for (const Keyframe& keyframe : window.keyframes) {
    next_.push_back(keyframe.points.begin());
  }
}

std::span<const KeyframeObservation> ObservationWalk::seek(int track_id) {
  found_.clear();
  for (std::size_t i = 0; i < next_.size(); ++i) {
    const Observations& points = window_.keyframes[i].points;
    while (next_[i] != points.end() && next_[i]->track_id < track_id) {
      ++next_[i];
    }
    if (next_[i] != points.end() && next_[i]->track_id == track_id) {
      found_.push_back({i, next_[i]->uv});
    }
  }
  return found_;
}

std::vector<Rigid3> poses_of(const Window& window) {
  std::vector<Rigid3> poses;
  poses.reserve(window.keyframes.size());
  for (const Keyframe& keyframe : window.keyframes) {
    poses.push_back(keyframe.world_from_camera.inverse());
  }
  return poses;
}

std::size_t leaving_keyframe(const Window& window, const Keyframe& coming) {
  const std::deque<Keyframe>& keyframes = window.keyframes;
  if (common_points(keyframes.front().points, coming.points).size() < kMinConnection) {
    return 0;
  }
  const auto position = [&](std::size_t i) -> const Eigen::Vector3d& {
    return keyframes[i].world_from_camera.translation;
  };
  std::size_t leaving = 0;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 1; i + kNumRecent <= keyframes.size(); ++i) {
    const double gap = (position(i + 1) - position(i - 1)).norm();
    const double age = (coming.world_from_camera.translation - position(i)).norm();
    // Gap over age: the further back, the wider the keyframes may stand.
    if (gap < least * age) {
      least = gap / age;
      leaving = i;
    }
  }
  return leaving;
}

std::vector<int> lost_tracks(const Window& window, std::size_t leaving, const Keyframe& coming) {
  const Keyframe& keyframe = window.keyframes[leaving];
  std::vector<int> lost;
  for (const Observation& point : keyframe.points) {
    const auto sees = [&](const Keyframe& other) {
      return &other != &keyframe && find_point(other.points, point.track_id) != nullptr;
    };
    if (!sees(coming) && std::none_of(window.keyframes.begin(), window.keyframes.end(), sees)) {
      lost.push_back(point.track_id);
    }
  }
  return lost;
}

void add_keyframe(Window& window, Keyframe keyframe, const WindowOptions& options) {
  if (static_cast<int>(window.keyframes.size()) >= options.num_keyframes) {
    const std::size_t leaving = leaving_keyframe(window, keyframe);
    for (const int track_id : lost_tracks(window, leaving, keyframe)) {
      window.landmarks.erase(track_id);
      window.fixed.erase(track_id);
    }
    window.keyframes.erase(window.keyframes.begin() + static_cast<std::ptrdiff_t>(leaving));
  }
  window.keyframes.push_back(std::move(keyframe));
}

void triangulate_landmarks(Window& window, const Camera& camera, const WindowOptions& options) {
  if (window.keyframes.size() < 2) {
    return;
  }
  const std::vector<Rigid3> poses = poses_of(window);
  ObservationWalk walk(window);
  for (const Observation& point : window.keyframes.back().points) {
    if (window.landmarks.contains(point.track_id)) {
      continue;
    }
    if (const auto landmark =
            triangulate_track(window, walk.seek(point.track_id), poses, camera, options)) {
      window.landmarks.emplace(point.track_id, *landmark);
    }
  }
}

void cull_landmarks(Window& window, const Camera& camera, const WindowOptions& options) {
  const std::vector<Rigid3> poses = poses_of(window);
  ObservationWalk walk(window);
  std::erase_if(window.landmarks, [&](const auto& landmark) {
    const auto& [track_id, point_in_world] = landmark;
    return !is_seen_well(point_in_world, walk.seek(track_id), poses, camera,
                         options.max_reprojection_error_px);
  });
  std::erase_if(window.fixed, [&](int track_id) { return !window.landmarks.contains(track_id); });
}

void fix_landmarks(Window& window,
                   const Camera& camera,
                   const std::map<int, Eigen::Vector3d>& known,
                   double bound_px) {
  const std::vector<Rigid3> poses = poses_of(window);
  std::map<int, Eigen::Vector3d> agreeing;
  std::size_t num_seen = 0;
  ObservationWalk walk(window);
  for (const auto& [track_id, point_in_world] : known) {
    const std::span<const KeyframeObservation> observations = walk.seek(track_id);
    num_seen += observations.empty() ? 0 : 1;
    if (!observations.empty() &&
        is_seen_well(point_in_world, observations, poses, camera, bound_px)) {
      agreeing.emplace(track_id, point_in_world);
    }
  }
  if (2 * agreeing.size() < num_seen) {
    return;
  }
  for (const auto& [track_id, point_in_world] : agreeing) {
    window.landmarks[track_id] = point_in_world;
    window.fixed.insert(track_id);
  }
}

void move(Window& window, const Similarity3& moved) {
  for (Keyframe& keyframe : window.keyframes) {
    keyframe.world_from_camera = moved * keyframe.world_from_camera;
  }
  for (auto& [track_id, point] : window.landmarks) {
    point = moved * point;
  }
}

void rescale(Window& window, double factor, const Eigen::Vector3d& center) {
  const auto scaled = [&](const Eigen::Vector3d& point) -> Eigen::Vector3d {
    return center + factor * (point - center);
  };
  for (Keyframe& keyframe : window.keyframes) {
    keyframe.world_from_camera.translation = scaled(keyframe.world_from_camera.translation);
  }
  for (auto& [track_id, point] : window.landmarks) {
    point = scaled(point);
  }
}

}  // namespace stemvo
