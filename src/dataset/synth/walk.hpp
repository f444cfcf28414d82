// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>

#include "dataset/synth/courtyard.hpp"
#include "dataset/synth/drive.hpp"
#include "stemvo/evaluation/trajectory.hpp"

namespace stemvo::synth {

/// Poses of a hand-held camera, and where they are.
struct Walk {
  Trajectory world_from_camera;
  Courtyard courtyard;
};

inline constexpr double kWalkSpeed_m_s = 0.5;

/// A walk with a camera in the hand, some 1.5 m above the floor: the sway of steps, slow wander of
/// the view, and what WalkPlan has planned.
[[nodiscard]] Walk make_walk(int num_frames, std::uint64_t seed, const Pace& pace);

}  // namespace stemvo::synth
