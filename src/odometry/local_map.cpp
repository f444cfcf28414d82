// SPDX-License-Identifier: MIT
#include "odometry/local_map.hpp"

#include <algorithm>
#include <utility>

namespace stemvo {

const MapObservation* find_observation(const Keyframe& keyframe, int track_id) {
  const auto found = std::lower_bound(
      keyframe.observations.begin(), keyframe.observations.end(), track_id,
      [](const MapObservation& observation, int id) { return observation.track_id < id; });
  const bool is_there = found != keyframe.observations.end() && found->track_id == track_id;
  return is_there ? &*found : nullptr;
}

void add_keyframe(LocalMap& map, Keyframe keyframe, const LocalMapOptions& options) {
  std::sort(keyframe.observations.begin(), keyframe.observations.end(),
            [](const auto& a, const auto& b) { return a.track_id < b.track_id; });
  map.keyframes.push_back(std::move(keyframe));
  while (static_cast<int>(map.keyframes.size()) > options.num_keyframes) {
    map.keyframes.pop_front();
  }
  // A track ends for good once it is not followed: only those of the newest keyframe live on, the
  // others stay as long as the window sees them.
  std::erase_if(map.landmarks, [&](const auto& landmark) {
    return std::none_of(map.keyframes.begin(), map.keyframes.end(), [&](const Keyframe& seen_from) {
      return find_observation(seen_from, landmark.first) != nullptr;
    });
  });
}

}  // namespace stemvo
