// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "stemvo/camera.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

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
  Camera camera;             ///< as it was when the frame came
  Rigid3 world_from_camera;  ///< in the trajectory, as it came
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
};

/// A place that was seen again: keyframe `to`, the later one, shows what `from` showed.
struct Loop : MapEdge {
  std::vector<std::pair<int, int>> corners;  ///< indices into from's and to's that are one landmark
};

/// How long a unit is.
struct MapLength {
  int keyframe = 0;
  double log_metres_per_unit = 0.0;
  double sigma = 0.0;
};

/// The map that remembers: nodes of a graph, what connects them, and where they are.
struct KeptMap {
  std::vector<KeptKeyframe> keyframes;         ///< in the order of their frames
  std::vector<Similarity3> map_from_keyframe;  ///< one per keyframe
  std::vector<MapEdge> motions;                ///< between keyframes that follow each other
  std::vector<Loop> loops;
  std::vector<MapLength> lengths;  ///< where somebody measured metres
};

}  // namespace stemvo
