// SPDX-License-Identifier: MIT
#pragma once

#include <span>
#include <vector>

#include "mapping/kept_map.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// Where each frame is in the map: map_from_camera, whose lengths are those of the frame's pose in
/// the trajectory. A frame goes with the keyframes on both sides of it, more with the nearer in
/// time; one before the first or behind the last with that one alone, and with the one before where
/// the trajectory jumps to the next. Keyframes whose frame is below 0 are of another recording.
/// Without any the map is the trajectory's world.
/// `world_from_camera`, `times_s`: of all frames.
[[nodiscard]] std::vector<Similarity3> place_trajectory(std::span<const Rigid3> world_from_camera,
                                                        std::span<const double> times_s,
                                                        const KeptMap& map);

}  // namespace stemvo
