// SPDX-License-Identifier: MIT
#pragma once

#include <vector>

#include "mapping/kept_map.hpp"

namespace stemvo {

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

}  // namespace stemvo
