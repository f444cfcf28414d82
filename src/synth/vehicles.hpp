// SPDX-License-Identifier: MIT
#pragma once

#include "synth/drive.hpp"

namespace stemvo::synth {

/// At the kerb on the right, seen from behind.
void add_parked_car(const RoadFrame& place, Draw draw, Scene& scene);

}  // namespace stemvo::synth
