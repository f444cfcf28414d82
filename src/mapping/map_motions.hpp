// SPDX-License-Identifier: MIT
#pragma once

#include "mapping/kept_map.hpp"
#include "mapping/map_keeper.hpp"

namespace stemvo {

/// A guess's standard deviation of log(scale).
constexpr double kGuessLogScale = 1.0;

/// The motion from `from`, which is this node, to `to`, the next one, with its sigmas; each
/// keyframe has its own unit.
[[nodiscard]] MapEdge motion_between(const WindowView& view,
                                     const Keyframe& from,
                                     const Keyframe& to,
                                     int node);
/// The guess that connects the first keyframe of a new map with the last one of the map before.
[[nodiscard]] MapEdge guessed_motion(const KeptKeyframe& from, const KeptKeyframe& to, int node);

}  // namespace stemvo
