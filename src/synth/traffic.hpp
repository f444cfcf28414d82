// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "synth/drive.hpp"

namespace stemvo::synth {

/// Everything that moves in a street on its own: a car or lorry ahead, close from the first frame
/// on; others oncoming; people on the sidewalks. Where the camera stands at a crossing, cars cross
/// and people walk over the road before it. All of it depends on the drive, the seed and the time
/// alone.
struct Traffic {
  std::vector<int> crossings;  ///< middles of the roads that cross: knots, where seen first
  /// Adds all of it around the camera at a frame, or between frames. What stands at that moment
  /// does not move.
  std::function<void(double frame, Scene& scene)> add_at;
};
[[nodiscard]] Traffic plan_traffic(const Drive& drive, std::uint64_t seed);

}  // namespace stemvo::synth
