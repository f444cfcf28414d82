// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>

#include "mapping/kept_map.hpp"

namespace stemvo {

/// Moves map_from_keyframe to where motions, loops and lengths agree best, from where it is. Node
/// 0 stays; its scale moves where the map has lengths, which make the map's unit a metre.
/// Motions and lengths are believed; sigmas are above 0. A loop is under Cauchy's loss:
/// where the others contradict it by many sigmas it pulls no more. One thread, no clock: the same
/// bytes on every run. False: nothing to do, or not solved; the map is unchanged.
bool solve_pose_graph(KeptMap& map);

/// Sigma of a length if its error were like no other one's: a filter remembers, so that lengths
/// that follow each other err alike.
[[nodiscard]] double independent_sigma(const KeptMap& map, std::size_t length);

/// The graph has taken a loop in that is off by less (sigmas_off).
inline constexpr double kMaxTakenInSigmas = 5.0;
/// How far map_from_keyframe is from what an edge measured: the length of its seven errors in their
/// sigmas. Of a true one, whose sigmas hold, the square is 7 on average.
[[nodiscard]] double sigmas_off(const KeptMap& map, const MapEdge& edge);

/// Whether odometry may have drifted as far as a loop claims: between its keyframes, what it says
/// against what map_from_keyframe says, by the sigmas of the surest way from the one to the other,
/// through motions and loops that the graph has taken in, and of lengths where metres were
/// measured. Two streets may look alike; that one lies half of the path away. True where motions
/// are missing, or are guesses: nothing is known then.
///
/// `graph`: with all motions up to the loop's later keyframe.
[[nodiscard]] bool is_within_drift(const KeptMap& graph, const MapEdge& loop);

}  // namespace stemvo
