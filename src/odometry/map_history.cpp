// SPDX-License-Identifier: MIT
#include "odometry/map_history.hpp"

#include "stemvo/check.hpp"

namespace stemvo {
namespace {

KeyframeMotion motion_between(const Keyframe& prev, const Keyframe& cur) {
  return {prev.frame, cur.frame, prev.world_from_camera.inverse() * cur.world_from_camera};
}

}  // namespace

void MapHistory::leave(const LocalMap& map) {
  if (map.keyframes.size() >= 2) {
    motions_.push_back(motion_between(map.keyframes[0], map.keyframes[1]));
  }
}

void MapHistory::close(const LocalMap& map) {
  for (std::size_t i = 1; i < map.keyframes.size(); ++i) {
    motions_.push_back(motion_between(map.keyframes[i - 1], map.keyframes[i]));
  }
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
