// SPDX-License-Identifier: MIT
#include "odometry/window_history.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>

#include "internal_check.hpp"

namespace stemvo {
namespace {

/// A kept landmark: seen from so many keyframes, under so large an angle between two of them.
constexpr int kMinKeyframes = 4;
constexpr double kMinParallax_rad = 1.5 * std::numbers::pi / 180.0;
/// Lengths are the mean of so many frames' before and after.
constexpr int kScaleFrames = 5;

double parallax_rad(const Eigen::Vector3d& point, const Keyframe& a, const Keyframe& b) {
  const Eigen::Vector3d from_a = point - a.world_from_camera.translation;
  const Eigen::Vector3d from_b = point - b.world_from_camera.translation;
  return std::atan2(from_a.cross(from_b).norm(), from_a.dot(from_b));
}

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
  for (const Observation& observation : newest.points) {
    const auto sees = [&](const Keyframe& keyframe) {
      return find_point(keyframe.points, observation.track_id) != nullptr;
    };
    const auto [found, is_new] = tracks_.try_emplace(observation.track_id);
    Track& track = found->second;
    // A new corner came to its first keyframe with the frame behind it.
    track.num_keyframes +=
        is_new ? static_cast<int>(std::ranges::count_if(window.keyframes, sees)) : 1;
    track.rgb = color_at(image, observation.uv);  // the last view is the nearest
    const auto landmark = window.landmarks.find(observation.track_id);
    if (landmark == window.landmarks.end()) {
      continue;
    }
    const auto oldest = std::ranges::find_if(window.keyframes, sees);
    track.max_parallax_rad =
        std::max(track.max_parallax_rad, parallax_rad(landmark->second, *oldest, newest));
  }
}

double WindowHistory::units_of(int frame) const {
  const auto last = static_cast<int>(scale_of_frame_.size()) - 1;
  if (frame > last) {
    return 1.0;
  }
  const bool is_after_first = frame >= first_scaled_frame_;
  const int from = std::max(frame - kScaleFrames, is_after_first ? first_scaled_frame_ : 0);
  const int to = std::min(frame + kScaleFrames, is_after_first ? last : first_scaled_frame_ - 1);
  const auto at = [&](int index) { return scale_of_frame_.begin() + index; };
  return std::accumulate(at(from), at(to + 1), 0.0) / ((to + 1 - from) * scale_);
}

void WindowHistory::keep_motion(int prev, int cur, Rigid3 prev_from_cur) {
  prev_from_cur.translation *= units_of(cur);
  motions_.push_back({prev, cur, prev_from_cur});
}

void WindowHistory::keep(const Window& window, const Keyframe& last_seen_from, int track_id) {
  const auto track = tracks_.find(track_id);
  if (track == tracks_.end()) {
    return;
  }
  const auto landmark = window.landmarks.find(track_id);
  if (landmark != window.landmarks.end() && track->second.num_keyframes >= kMinKeyframes &&
      track->second.max_parallax_rad >= kMinParallax_rad) {
    const Eigen::Vector3d in_camera =
        units_of(last_seen_from.frame) *
        (last_seen_from.world_from_camera.inverse() * landmark->second);
    landmarks_.push_back({last_seen_from.frame, in_camera.cast<float>(), track->second.rgb});
  }
  tracks_.erase(track);
}

void WindowHistory::keep_non_keyframes(const Keyframe& keyframe) {
  for (const NonKeyframe& non_keyframe : keyframe.non_keyframes) {
    keep_motion(keyframe.frame, non_keyframe.frame, non_keyframe.keyframe_from_camera);
  }
}

void WindowHistory::keep_motions(const Keyframe& prev, const Keyframe& cur) {
  keep_non_keyframes(prev);
  keep_motion(prev.frame, cur.frame, prev.world_from_camera.inverse() * cur.world_from_camera);
}

void WindowHistory::leave(const Window& window, std::size_t leaving, const Keyframe& coming) {
  const Keyframe& keyframe = window.keyframes[leaving];
  if (leaving == 0) {
    keep_motions(keyframe, window.keyframes.size() > 1 ? window.keyframes[1] : coming);
  }
  for (const int track_id : lost_tracks(window, leaving, coming)) {
    keep(window, keyframe, track_id);
  }
}

void WindowHistory::rescale(const Window& window, double factor, bool is_first) {
  scale_ *= factor;
  if (is_first && !window.keyframes.empty()) {
    first_scaled_frame_ = window.keyframes.front().frame;
    for (auto frame = static_cast<std::size_t>(first_scaled_frame_); frame < scale_of_frame_.size();
         ++frame) {
      scale_of_frame_[frame] *= factor;
    }
  }
}

void WindowHistory::close(const Window& window) {
  for (std::size_t i = 1; i < window.keyframes.size(); ++i) {
    keep_motions(window.keyframes[i - 1], window.keyframes[i]);
  }
  if (!window.keyframes.empty()) {
    keep_non_keyframes(window.keyframes.back());
  }
  for (auto keyframe = window.keyframes.rbegin(); keyframe != window.keyframes.rend(); ++keyframe) {
    for (const Observation& observation : keyframe->points) {
      keep(window, *keyframe, observation.track_id);
    }
  }
  tracks_.clear();
}

std::vector<Rigid3> refined_poses(std::span<const Rigid3> world_from_camera,
                                  std::span<const WindowMotion> motions) {
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
