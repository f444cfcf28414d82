// SPDX-License-Identifier: MIT
#pragma once

#include "synth/drive.hpp"

namespace stemvo::synth {

/// Half the width of the road that crosses.
inline constexpr int kCrossingHalf_m = 4;
/// It ends so far from the street's middle, at a house.
inline constexpr double kCrossingEnd_m = 32.0;

/// The scene beyond the street's edges: the crossing road, hedges along it, houses at its ends, and
/// lights.
void add_side_streets(const RoadFrame& middle, std::uint64_t seed, Scene& scene);

}  // namespace stemvo::synth
