// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "stemvo/camera.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// A number of a keyframe, or of a corner, as an index.
[[nodiscard]] constexpr std::size_t slot(int number) { return static_cast<std::size_t>(number); }

/// 256 comparisons of the channel around a corner, one bit each.
using Descriptor = std::array<std::uint64_t, 4>;

/// A corner of a keyframe.
struct KeptCorner {
  int track_id = -1;                             ///< the same in keyframes that follow each other
  Eigen::Vector2f uv = Eigen::Vector2f::Zero();  ///< input pixels
  /// Its landmark in the keyframe's camera, in the keyframe's unit; NaN: it has none.
  Eigen::Vector3f in_camera = Eigen::Vector3f::Constant(std::numeric_limits<float>::quiet_NaN());

  [[nodiscard]] bool has_landmark() const { return !std::isnan(in_camera.x()); }
};

/// A keyframe as it is kept. Its unit of length is that of its pose in the trajectory.
struct KeptKeyframe {
  int frame = 0;
  double time_s = 0.0;
  Camera camera;  ///< as it was when the frame came
  Eigen::Vector2d radial =
      Eigen::Vector2d::Zero();  ///< of the RadialLens that corners are freed of
  Rigid3 world_from_camera;     ///< in the trajectory, as it came
  std::vector<KeptCorner>
      corners;  ///< ordered by track id; empty: it shows a place that is kept already
  std::vector<Descriptor> descriptors;  ///< one per corner; empty: it is no place to be recognized
};

/// A motion between two keyframes, measured.
struct MapEdge {
  int from = 0;
  int to = 0;           ///< numbers of keyframes in the map
  Similarity3 from_to;  ///< a point of keyframe `to` -> of keyframe `from`, each in its unit
  /// Standard deviations.
  double sigma_rad = 0.0;          ///< of the rotation, per axis
  double sigma_translation = 0.0;  ///< per axis, in units of `from`
  double sigma_log_scale = 0.0;

  /// Nothing measured it, or not how long it is.
  [[nodiscard]] bool is_guess() const { return std::max(sigma_rad, sigma_log_scale) >= 1.0; }
};

/// A place that was seen again: keyframe `to`, the later one, shows what `from` showed.
struct Loop : MapEdge {
  /// Indices into from's and to's that are one landmark; empty: made of other loops and motions,
  /// or where a lost frame was found.
  std::vector<std::pair<int, int>> corners;
};

/// How long a unit is.
struct MapLength {
  int keyframe = 0;
  double log_metres_per_unit = 0.0;
  double sigma = 0.0;
};

/// A keyframe that showed a kept place and is no node any more.
struct MergedKeyframe {
  int frame = 0;
  Rigid3 world_from_camera;  ///< in the trajectory, as it came
  int keyframe = 0;          ///< where its pose hangs: number of a keyframe in the map
  Similarity3 keyframe_from_merged;
  bool is_recognized = false;  ///< there was a loop from that keyframe to it
};

/// The map that remembers: nodes of a graph, what connects them, and where they are.
struct KeptMap {
  std::vector<KeptKeyframe> keyframes;         ///< in the order of their frames
  std::vector<Similarity3> map_from_keyframe;  ///< one per keyframe
  std::vector<MapEdge> motions;                ///< between keyframes that follow each other
  std::vector<Loop> loops;                     ///< that were found, or are made of such
  std::vector<MapLength> lengths;              ///< where somebody measured metres
  std::vector<MergedKeyframe> merged;          ///< in the order of their frames

  [[nodiscard]] const Similarity3& pose(int keyframe) const {
    return map_from_keyframe[slot(keyframe)];
  }
};

/// Frames that show one place, the earlier one first; those of another recording are negative.
[[nodiscard]] inline std::vector<std::pair<int, int>> frames_of_loops(const KeptMap& map) {
  const auto frame_of = [&](int k) { return map.keyframes[static_cast<std::size_t>(k)].frame; };
  std::vector<std::pair<int, int>> frames;
  for (const MergedKeyframe& merged : map.merged) {
    if (merged.is_recognized) {
      frames.emplace_back(frame_of(merged.keyframe), merged.frame);
    }
  }
  for (const Loop& loop : map.loops) {
    if (!loop.corners.empty()) {
      frames.emplace_back(frame_of(loop.from), frame_of(loop.to));
    }
  }
  return frames;
}

/// The motion by one edge and another behind it: a.to is b.from.
[[nodiscard]] MapEdge chained(const MapEdge& a, const MapEdge& b);
/// The same edge from its other end.
[[nodiscard]] MapEdge reversed(const MapEdge& edge);

/// Merges keyframes between two that were recognized, without a new place in between, into the
/// places that they show: a camera that stays in a room adds no nodes, edges and corners for ever.
/// Each leaves its pose relative to the place; edges to the others that stay go on from there.
/// Keyframes from number `end` on are in use still. Returns the new number of each keyframe, -1 for
/// those that are none any more; empty: nothing was worth it.
[[nodiscard]] std::vector<int> merge_known_terrain(KeptMap& map, int end);

/// Where each frame is in the map: map_from_camera, whose lengths are those of the frame's pose in
/// the trajectory. A frame goes with the keyframes on both sides of it, more with the nearer in
/// time; one before the first or behind the last with that one alone, and with the one before where
/// the trajectory jumps to the next. Keyframes whose frame is below 0 are of another recording.
/// Without any the map is the trajectory's world.
/// `world_from_camera`, `times_s`: of all frames.
[[nodiscard]] std::vector<Similarity3> place_trajectory(std::span<const Rigid3> world_from_camera,
                                                        std::span<const double> times_s,
                                                        const KeptMap& map);

}  // namespace stemvo
