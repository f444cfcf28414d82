// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "dataset/synth/materials.hpp"

namespace stemvo::synth {

/// What is infinitely far: blue with thin clouds, wooded hills on the horizon, fields below it. It
/// moves with the camera's rotation only.
class Sky {
 public:
  explicit Sky(std::uint64_t seed);

  /// `direction` in world axes (-y up), any length; `pixel_rad` is the angle of one pixel.
  [[nodiscard]] Rgb colour(const Eigen::Vector3d& direction,
                           double pixel_rad,
                           const Textures& textures) const;

 private:
  std::vector<float> ridge_rad_;  ///< height of the hills around the horizon
};

/// Colour of the air, and how much of it lies before a thing at that distance.
inline constexpr Rgb kHaze = {0.60F, 0.63F, 0.66F};
[[nodiscard]] float haze_share(float distance_m);
/// Things dissolve into the backdrop from 110 m on and are gone at 165 m, before the drawn part of
/// a street ends: nothing pops up.
[[nodiscard]] float backdrop_share(float distance_m);

}  // namespace stemvo::synth
