// SPDX-License-Identifier: MIT
#include "odometry/map_history.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "stemvo/check.hpp"

namespace stemvo {
namespace {

/// A kept landmark: seen from so many keyframes, under so large an angle between two of them.
constexpr int kMinKeyframes = 3;
constexpr double kMinParallax_rad = 1.5 * std::numbers::pi / 180.0;

KeyframeMotion motion_between(const Keyframe& prev, const Keyframe& cur) {
  return {prev.frame, cur.frame, prev.world_from_camera.inverse() * cur.world_from_camera};
}

double parallax_rad(const Eigen::Vector3d& point, const Keyframe& a, const Keyframe& b) {
  const Eigen::Vector3d from_a = point - a.world_from_camera.translation;
  const Eigen::Vector3d from_b = point - b.world_from_camera.translation;
  return std::atan2(from_a.cross(from_b).norm(), from_a.dot(from_b));
}

std::array<std::uint8_t, 3> color_at(const cv::Mat& picture, const Eigen::Vector2d& uv) {
  const cv::Point pixel(std::clamp(static_cast<int>(std::lround(uv.x())), 0, picture.cols - 1),
                        std::clamp(static_cast<int>(std::lround(uv.y())), 0, picture.rows - 1));
  if (picture.channels() == 3) {
    const auto& rgb = picture.at<cv::Vec3b>(pixel);
    return {rgb[0], rgb[1], rgb[2]};
  }
  const auto gray = picture.at<std::uint8_t>(pixel);
  return {gray, gray, gray};
}

}  // namespace

void MapHistory::look(const LocalMap& map, const cv::Mat& picture) {
  if (!keeps_landmarks_ || map.keyframes.empty()) {
    return;
  }
  const Keyframe& newest = map.keyframes.back();
  for (const MapObservation& observation : newest.observations) {
    Track& track = tracks_[observation.track_id];
    ++track.num_keyframes;
    track.rgb = color_at(picture, observation.uv);  // the last view is the nearest
    const auto landmark = map.landmarks.find(observation.track_id);
    if (landmark == map.landmarks.end()) {
      continue;
    }
    const auto oldest =
        std::find_if(map.keyframes.begin(), map.keyframes.end(), [&](const Keyframe& keyframe) {
          return find_observation(keyframe, observation.track_id) != nullptr;
        });
    track.max_parallax_rad =
        std::max(track.max_parallax_rad, parallax_rad(landmark->second, *oldest, newest));
  }
}

void MapHistory::keep(const LocalMap& map, const Keyframe& last_seen_from, int track_id) {
  const auto track = tracks_.find(track_id);
  if (track == tracks_.end()) {
    return;
  }
  const auto landmark = map.landmarks.find(track_id);
  if (landmark != map.landmarks.end() && track->second.num_keyframes >= kMinKeyframes &&
      track->second.max_parallax_rad >= kMinParallax_rad) {
    const Eigen::Vector3d in_camera = last_seen_from.world_from_camera.inverse() * landmark->second;
    landmarks_.push_back({last_seen_from.frame, in_camera.cast<float>(), track->second.rgb});
  }
  tracks_.erase(track);
}

void MapHistory::leave(const LocalMap& map, const Keyframe& coming) {
  const Keyframe& oldest = map.keyframes.front();
  const Keyframe& next = map.keyframes.size() > 1 ? map.keyframes[1] : coming;
  motions_.push_back(motion_between(oldest, next));
  if (!keeps_landmarks_) {
    return;
  }
  for (const MapObservation& observation : oldest.observations) {
    const auto sees = [&](const Keyframe& keyframe) {
      return find_observation(keyframe, observation.track_id) != nullptr;
    };
    if (!sees(coming) && std::none_of(map.keyframes.begin() + 1, map.keyframes.end(), sees)) {
      keep(map, oldest, observation.track_id);
    }
  }
}

void MapHistory::close(const LocalMap& map) {
  for (std::size_t i = 1; i < map.keyframes.size(); ++i) {
    motions_.push_back(motion_between(map.keyframes[i - 1], map.keyframes[i]));
  }
  for (auto keyframe = map.keyframes.rbegin(); keyframe != map.keyframes.rend(); ++keyframe) {
    for (const MapObservation& observation : keyframe->observations) {
      keep(map, *keyframe, observation.track_id);
    }
  }
  tracks_.clear();
}

std::vector<Rigid3> refined_poses(std::span<const Rigid3> world_from_camera,
                                  std::span<const KeyframeMotion> motions) {
  std::vector<Rigid3> poses(world_from_camera.begin(), world_from_camera.end());
  auto motion = motions.begin();
  for (std::size_t i = 1; i < poses.size(); ++i) {
    const auto frame = static_cast<int>(i);
    if (motion != motions.end() && motion->cur == frame) {
      STEMVO_CHECK(motion->prev >= 0 && motion->prev < frame, "motions come in order");
      poses[i] = poses[static_cast<std::size_t>(motion->prev)] * motion->prev_from_cur;
      ++motion;
    } else {
      poses[i] = poses[i - 1] * (world_from_camera[i - 1].inverse() * world_from_camera[i]);
    }
  }
  STEMVO_CHECK(motion == motions.end(), "every motion belongs to a frame");
  return poses;
}

}  // namespace stemvo
