// SPDX-License-Identifier: MIT
#pragma once

#include "synth/drive.hpp"

namespace stemvo::synth {

/// At the kerb on the right, seen from behind.
void add_parked_car(const RoadFrame& place, Draw draw, Scene& scene);

/// Things that may move stand on their shadow. `at`: the middle of the rear end, and the axes,
/// where `forward` is the way they go.
void add_car(const RoadFrame& at, Draw draw, bool moves, Scene& scene);
inline constexpr double kLorryLength_m = 8.2;
void add_lorry(const RoadFrame& at, Draw draw, bool moves, Scene& scene);
/// `stride_rad`: how far the steps are; a person who stands keeps it.
void add_person(const RoadFrame& at, Draw draw, double stride_rad, bool moves, Scene& scene);

}  // namespace stemvo::synth
