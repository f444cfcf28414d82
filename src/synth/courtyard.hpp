// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstdint>

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

/// The courtyard seen from `camera_position`.
[[nodiscard]] Scene build_courtyard(const Courtyard& courtyard,
                                    const Vec3& camera_position,
                                    const Vec3& to_sun);

}  // namespace stemvo::synth
