// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>

#include "mapping/kept_map.hpp"

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
  constexpr double kMaxStepSigmas = 5.0;
  std::vector<char> connected(map.keyframes.size());
  for (const MapEdge& edge : map.motions) {
    const auto to = slot(edge.to);
    if (edge.from + 1 == edge.to) {
      const Rigid3 came =
          map.keyframes[to - 1].world_from_camera.inverse() * map.keyframes[to].world_from_camera;
      connected[to] |= static_cast<char>(came.rotation.angularDistance(edge.from_to.rotation) <
                                             kMaxStepSigmas * edge.sigma_rad &&
                                         (came.translation - edge.from_to.translation).norm() <
                                             kMaxStepSigmas * edge.sigma_translation);
    }
  }
  return connected;
}

/// A frame of this recording whose place in the map is known.
struct Placed {
  int frame = 0;
  Similarity3 map_from_world;
  bool is_merged = false;
  bool is_connected = false;  ///< with the one before
};

std::vector<Placed> placed_frames(const KeptMap& map, int num_frames) {
  const std::vector<char> connected = find_connected(map);
  std::vector<Placed> placed;
  const auto place = [&](const auto& keyframe, const Similarity3& at, bool is_merged,
                         bool follows) {
    if (keyframe.frame >= 0 && keyframe.frame < num_frames) {
      placed.push_back({keyframe.frame, at * Similarity3(keyframe.world_from_camera.inverse()),
                        is_merged, follows});
    }
  };
  for (std::size_t i = 0; i < map.keyframes.size(); ++i) {
    place(map.keyframes[i], map.map_from_keyframe[i], false, connected[i] != 0);
  }
  for (const MergedKeyframe& merged : map.merged) {
    place(merged, map.map_from_keyframe[slot(merged.keyframe)] * merged.keyframe_from_merged, true,
          true);
  }
  std::ranges::sort(placed, {}, &Placed::frame);
  // The motion from what was merged is an edge of its place now.
  for (std::size_t i = 1; i < placed.size(); ++i) {
    placed[i].is_connected = placed[i].is_connected || placed[i - 1].is_merged;
  }
  return placed;
}

}  // namespace

std::vector<Similarity3> place_trajectory(std::span<const Rigid3> world_from_camera,
                                          std::span<const double> times_s,
                                          const KeptMap& map) {
  const std::vector<Placed> placed = placed_frames(map, static_cast<int>(times_s.size()));
  // A keyframe's own time is of another clock.
  const auto time_of = [&](const Placed& frame) {
    return times_s[static_cast<std::size_t>(frame.frame)];
  };
  std::vector<Similarity3> map_from_camera;
  for (std::size_t i = 0; i < world_from_camera.size(); ++i) {
    const auto by = [&](const Placed& frame) {
      return frame.map_from_world * Similarity3(world_from_camera[i]);
    };
    const auto after = std::ranges::lower_bound(placed, static_cast<int>(i), {}, &Placed::frame);
    const bool is_placed = after != placed.end() && after->frame == static_cast<int>(i);
    if (placed.empty()) {
      map_from_camera.emplace_back(world_from_camera[i]);
    } else if (after == placed.begin() || is_placed) {
      map_from_camera.push_back(by(*after));
    } else if (after == placed.end() || !after->is_connected) {
      map_from_camera.push_back(by(*std::prev(after)));
    } else {
      const Placed& before = *std::prev(after);
      const double share = (times_s[i] - time_of(before)) / (time_of(*after) - time_of(before));
      map_from_camera.push_back(between(by(before), by(*after), share));
    }
  }
  return map_from_camera;
}

}  // namespace stemvo
