// SPDX-License-Identifier: MIT
#include "odometry/window_history.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

namespace stemvo {
namespace {

/// A kept landmark: seen from so many keyframes, under so large an angle between two of them.
constexpr int kMinKeyframes = 4;
constexpr double kMinParallax_rad = 1.5 * std::numbers::pi / 180.0;

std::array<std::uint8_t, 3> color_at(const cv::Mat& image, const Eigen::Vector2d& uv) {
  const cv::Point pixel(std::clamp(static_cast<int>(std::lround(uv.x())), 0, image.cols - 1),
                        std::clamp(static_cast<int>(std::lround(uv.y())), 0, image.rows - 1));
  if (image.channels() == 3) {
    const auto& rgb = image.at<cv::Vec3b>(pixel);
    return {rgb[0], rgb[1], rgb[2]};
  }
  const auto gray = image.at<std::uint8_t>(pixel);
  return {gray, gray, gray};
}

}  // namespace

void WindowHistory::observe(const Window& window, const cv::Mat& image) {
  const Keyframe& newest = window.keyframes.back();
  ObservationWalk walk(window);
  for (const Observation& observation : newest.points) {
    const std::span<const KeyframeObservation> views = walk.seek(observation.track_id);
    const auto [found, is_new] = tracks_.try_emplace(observation.track_id);
    Track& track = found->second;
    track.id = is_new ? num_landmarks_++ : track.id;
    // A new corner came to its first keyframe with the frame behind it.
    track.num_keyframes += is_new ? static_cast<int>(views.size()) : 1;
    track.rgb = color_at(image, observation.uv);  // the last view is the nearest
    const auto landmark = window.landmarks.find(observation.track_id);
    if (landmark != window.landmarks.end()) {
      const Keyframe& oldest = window.keyframes[views.front().keyframe];
      track.max_parallax_rad = std::max(
          track.max_parallax_rad,
          parallax_rad(landmark->second, oldest.world_from_camera, newest.world_from_camera));
    }
  }
  // Which landmarks of the window are well constrained.
  window_moved_at_ = now();
  for (auto& [track_id, track] : tracks_) {
    const bool is_shown = track.num_keyframes >= kMinKeyframes &&
                          track.max_parallax_rad >= kMinParallax_rad &&
                          window.landmarks.contains(track_id);
    if (track.is_shown && !is_shown) {
      removed_.push_back({now(), track.id});
    }
    track.is_shown = is_shown;
  }
}

KeptLandmark WindowHistory::place(const Track& track,
                                  const Keyframe& last_seen_from,
                                  const Eigen::Vector3d& point) const {
  const Eigen::Vector3d in_camera =
      units(last_seen_from.frame) * (last_seen_from.world_from_camera.inverse() * point);
  return {track.id, last_seen_from.frame, in_camera.cast<float>(), track.rgb};
}

LandmarkChanges WindowHistory::changes_since(int version, const Window& window) const {
  LandmarkChanges changes{num_frames_, {}, {}};
  const auto after = [version](const auto& all) {
    const auto version_of = [](const auto& change) { return change.version; };
    return std::ranges::subrange(std::ranges::upper_bound(all, version, {}, version_of), all.end());
  };
  for (const Change<KeptLandmark>& change : after(left_)) {
    changes.landmarks.push_back(change.what);
  }
  for (const Change<int>& change : after(removed_)) {
    changes.removed.push_back(change.what);
  }
  if (window_moved_at_ <= version) {
    return changes;
  }
  std::set<int> placed;
  for (auto keyframe = window.keyframes.rbegin(); keyframe != window.keyframes.rend(); ++keyframe) {
    for (const Observation& observation : keyframe->points) {
      const auto track = tracks_.find(observation.track_id);
      if (track != tracks_.end() && track->second.is_shown &&
          placed.insert(observation.track_id).second) {
        changes.landmarks.push_back(
            place(track->second, *keyframe, window.landmarks.at(observation.track_id)));
      }
    }
  }
  return changes;
}

}  // namespace stemvo
