// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>

#include "config/config.hpp"
#include "odometry/phased_odometry.hpp"

namespace stemvo::fuzz {

/// Of the checkpoints that make_corpora writes.
inline constexpr const char* kIdentity = "program";
inline constexpr std::size_t kNumFrames = 1000;

/// Of small gray images, so that a state is small.
inline PhasedOdometry small_odometry() {
  Config config;
  config.stem.model = "gray";
  const Camera camera{
      .fx_px = 40, .fy_px = 40, .cx_px = 32, .cy_px = 24, .width_px = 64, .height_px = 48};
  return PhasedOdometry::create(camera, config).value();
}

}  // namespace stemvo::fuzz
