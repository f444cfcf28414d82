// SPDX-License-Identifier: MIT
#include "odometry/window.hpp"

#include <algorithm>
#include <utility>

namespace stemvo {

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
