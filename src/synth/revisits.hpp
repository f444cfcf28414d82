// SPDX-License-Identifier: MIT
#pragma once

#include <vector>

#include "synth/drive.hpp"

namespace stemvo::synth {

/// Per knot of a road: the knot of an earlier part of the road on which it comes back, in the same
/// direction; or kNewPlace. Earlier parts are new places themselves.
inline constexpr int kNewPlace = -1;
[[nodiscard]] std::vector<int> find_revisits(const RoadCurve& road);

/// Metres per knot, upwards, that bring each street's second visit to the height of its first.
/// Between visits they change evenly along the road.
[[nodiscard]] std::vector<double> lifts_to_first_visit(const RoadCurve& road,
                                                       const std::vector<int>& homes);

/// The same road, but on the earlier part where it comes back to it.
[[nodiscard]] RoadCurve joined(const RoadCurve& road, const std::vector<int>& homes);

}  // namespace stemvo::synth
