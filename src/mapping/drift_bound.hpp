// SPDX-License-Identifier: MIT
#pragma once

#include "mapping/kept_map.hpp"

namespace stemvo {

/// Whether odometry may have drifted as far as a loop claims: between its keyframes, what it says
/// against what map_from_keyframe says, by the sigmas of the surest way from the one to the other,
/// through motions and loops that the graph has taken in, and of lengths where metres were
/// measured. Two streets may look alike; that one lies half of the path away. True where motions
/// are missing, or are guesses: nothing is known then.
///
/// `graph`: with all motions up to the loop's later keyframe.
[[nodiscard]] bool is_within_drift(const KeptMap& graph, const MapEdge& loop);

}  // namespace stemvo
