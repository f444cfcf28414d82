// SPDX-License-Identifier: MIT
#pragma once

#include <span>
#include <vector>

#include "odometry/local_map.hpp"
#include "stemvo/geometry/rigid3.hpp"

namespace stemvo {

/// Motion between two keyframes as it was last refined.
struct KeyframeMotion {
  int prev = 0;  ///< frame numbers
  int cur = 0;
  Rigid3 prev_from_cur;
};

/// What the window leaves behind. Motions between neighbours are kept, not poses: the window is
/// rescaled and moved as a whole later on, and what has left must not be torn from it.
class MapHistory {
 public:
  /// The oldest keyframe is about to leave the window.
  void leave(const LocalMap& map);
  /// The whole window is about to be dropped; nothing will connect with it.
  void close(const LocalMap& map);

  [[nodiscard]] const std::vector<KeyframeMotion>& motions() const { return motions_; }

 private:
  std::vector<KeyframeMotion> motions_;
};

/// Poses of all frames, with look-ahead: a keyframe follows its predecessor by their refined
/// motion, any other frame the one before it as it did when it came. `motions` are ordered by
/// `cur`; frame numbers count `world_from_camera`, the poses as they came.
[[nodiscard]] std::vector<Rigid3> refined_poses(std::span<const Rigid3> world_from_camera,
                                                std::span<const KeyframeMotion> motions);

}  // namespace stemvo
