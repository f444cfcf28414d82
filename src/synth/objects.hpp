// SPDX-License-Identifier: MIT
#pragma once

#include "synth/drive.hpp"
#include "synth/scene.hpp"

namespace stemvo::synth {

/// Things that may move stand on their shadow. `at`: the middle of the rear end, and the axes,
/// where `forward` is the way they go. A parked car is plain and seen from behind.
void add_car(const RoadFrame& at, Draw draw, bool moves, Scene& scene, bool is_parked = false);
inline constexpr double kLorryLength_m = 8.2;
void add_lorry(const RoadFrame& at, Draw draw, bool moves, Scene& scene);
/// `stride_rad`: how far the steps are; a person who stands keeps it.
void add_person(const RoadFrame& at, Draw draw, double stride_rad, bool moves, Scene& scene);

inline const Rgb kAsphalt = {0.345F, 0.345F, 0.35F};
/// Half the width of the road that crosses.
inline constexpr int kCrossingHalf_m = 4;
/// It ends so far from the street's middle, at a house.
inline constexpr double kCrossingEnd_m = 32.0;

struct House {
  std::array<Vec3, 4> plan;  ///< front left, front right, back right, back left, as seen on foot
  Vec3 up;
  Style style;
  Scene& scene;

  /// Walls, and a gable roof with its ridge along the street, over the eaves by 12 cm.
  void add(double eaves_m, double rise_m, std::uint32_t roof_seed);
};

/// The scene beyond the street's edges: the crossing road, hedges along it, houses at its ends, and
/// lights.
void add_side_streets(const RoadFrame& middle, std::uint64_t seed, Scene& scene);

}  // namespace stemvo::synth
