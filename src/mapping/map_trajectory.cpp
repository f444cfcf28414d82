// SPDX-License-Identifier: MIT
#include "mapping/map_trajectory.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>

#include "internal_check.hpp"

namespace stemvo {
namespace {

/// Part of the way from a to b, which are near each other.
Similarity3 between(const Similarity3& a, const Similarity3& b, double share) {
  const Similarity3 a_from_b = a.inverse() * b;
  return a * Similarity3(std::pow(a_from_b.scale, share),
                         so3_exp(share * so3_log(a_from_b.rotation)), share * a_from_b.translation);
}

/// For each keyframe whether the trajectory came to it from the one before as was measured: it did
/// not where the world was moved, or where a lost camera was found.
std::vector<char> find_connected(const KeptMap& map) {
  constexpr double kMaxSigmas = 5.0;
  std::vector<char> connected(map.keyframes.size());
  for (const MapEdge& edge : map.motions) {
    const auto to = static_cast<std::size_t>(edge.to);
    if (edge.from + 1 == edge.to) {
      const Rigid3 came =
          map.keyframes[to - 1].world_from_camera.inverse() * map.keyframes[to].world_from_camera;
      connected[to] |= static_cast<char>(came.rotation.angularDistance(edge.from_to.rotation) <
                                             kMaxSigmas * edge.sigma_rad &&
                                         (came.translation - edge.from_to.translation).norm() <
                                             kMaxSigmas * edge.sigma_translation);
    }
  }
  return connected;
}

}  // namespace

std::vector<Similarity3> place_trajectory(std::span<const Rigid3> world_from_camera,
                                          std::span<const double> times_s,
                                          const KeptMap& map) {
  STEMVO_CHECK(world_from_camera.size() == times_s.size(), "a time per pose");
  const auto frame_of = [](const KeptKeyframe& keyframe) { return keyframe.frame; };
  const auto num_frames = static_cast<int>(times_s.size());
  const auto last = std::ranges::lower_bound(map.keyframes, num_frames, {}, frame_of);
  const std::span<const KeptKeyframe> keyframes(map.keyframes.begin(), last);
  const auto begin = std::ranges::lower_bound(keyframes, 0, {}, frame_of);
  // A keyframe's own time is of another clock.
  const auto time_of = [&](const KeptKeyframe& keyframe) {
    return times_s[static_cast<std::size_t>(keyframe.frame)];
  };
  const std::vector<char> connected = find_connected(map);
  std::vector<Similarity3> map_from_camera;
  for (std::size_t i = 0; i < world_from_camera.size(); ++i) {
    const auto by = [&](auto keyframe) {
      const auto number = static_cast<std::size_t>(std::distance(keyframes.begin(), keyframe));
      return map.map_from_keyframe[number] *
             Similarity3(keyframe->world_from_camera.inverse() * world_from_camera[i]);
    };
    const auto after =
        std::ranges::lower_bound(begin, keyframes.end(), static_cast<int>(i), {}, frame_of);
    const bool is_keyframe = after != keyframes.end() && after->frame == static_cast<int>(i);
    if (begin == keyframes.end()) {
      map_from_camera.emplace_back(world_from_camera[i]);
    } else if (after == begin || is_keyframe) {
      map_from_camera.push_back(by(after));
    } else if (after == keyframes.end() ||
               connected[static_cast<std::size_t>(after - keyframes.begin())] == 0) {
      map_from_camera.push_back(by(std::prev(after)));
    } else {
      const auto before = std::prev(after);
      const double share = (times_s[i] - time_of(*before)) / (time_of(*after) - time_of(*before));
      map_from_camera.push_back(between(by(before), by(after), share));
    }
  }
  return map_from_camera;
}

}  // namespace stemvo
