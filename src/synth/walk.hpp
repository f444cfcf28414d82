// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstdint>

#include "evaluation/trajectory.hpp"
#include "synth/scene.hpp"

namespace stemvo::synth {

/// A courtyard of some 8 m x 8 m: three walkways each way with a thing between every four of them,
/// walls all round. x right, z forward, floor at y = 0, -y up; metres.
struct Courtyard {
  std::uint64_t seed = 0;
  std::array<double, 3> x_m{};     ///< walkways along z
  std::array<double, 3> z_m{};     ///< walkways along x
  std::array<double, 4> wall_m{};  ///< from the outer walkways: left, right, near, far
};

[[nodiscard]] Courtyard lay_courtyard(std::uint64_t seed);
void add_courtyard(const Courtyard& courtyard, Scene& scene);

/// Poses of a hand-held camera, and the courtyard around them.
struct Walk {
  Trajectory world_from_camera;
  Courtyard courtyard;
};

/// A walk with a camera in the hand, some 1.5 m above the floor, at 0.5 m/s in the mean: the sway
/// of steps, slow wander of the view, turns, glances aside and pauses.
[[nodiscard]] Walk make_walk(int num_frames, std::uint64_t seed, double rate_hz);

}  // namespace stemvo::synth
