// SPDX-License-Identifier: MIT
#pragma once

#include "synth/scene.hpp"

namespace stemvo::synth {

struct House {
  std::array<Vec3, 4> plan;  ///< front left, front right, back right, back left, as seen on foot
  Vec3 up;
  Style style;
  Scene& scene;

  void add_walls(double height_m);
  /// A gable roof with its ridge along the street, over the eaves by 12 cm.
  void add_roof(double eaves_m, double rise_m, std::uint32_t seed);
};

}  // namespace stemvo::synth
