// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>

#include "synth/drive.hpp"

namespace stemvo::synth {

/// The same street driven again: up to 0.9 m further left or 0.6 m further right, with other sway,
/// at 0.9 to 1 times the speed, from between the first two frames on.
void drive_again(std::uint64_t seed, int visit, Drive& drive);

/// Light of a place at one time.
struct Daylight {
  Vec3 to_sun;
  double ambient_factor = 1.0;
  float gain = 1.0F;  ///< of the camera
};

/// Visit 0 is the first one.
[[nodiscard]] Daylight daylight(std::uint64_t seed, int visit);

}  // namespace stemvo::synth
