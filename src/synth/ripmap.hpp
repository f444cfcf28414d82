// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace stemvo::synth {

/// A square tile of noise that repeats without a seam, averaged beforehand over 1, 2, 4, ... texels
/// along each axis on its own ("ripmap"). A street is seen at grazing angles, where a pixel covers
/// a few millimetres across and half a metre along: averaging both axes alike (a mip-map) would
/// wash out what a real camera still sees, and averaging too little would flicker.
class Ripmap {
 public:
  static constexpr int kSizeLog2 = 10;
  static constexpr int kSize = 1 << kSizeLog2;

  /// kSize * kSize values, rows along v; they are shifted and scaled to mean 0, deviation 1.
  explicit Ripmap(std::vector<float> values);

  /// Mean over a box of `width_u` x `width_v` texels around (u, v), all in texels; any reals.
  [[nodiscard]] float sample(float u, float v, float width_u, float width_v) const;

 private:
  static constexpr int kLevels = kSizeLog2 + 1;

  [[nodiscard]] float bilinear(int level_u, int level_v, float u, float v) const;

  std::array<std::array<std::vector<float>, kLevels>, kLevels> levels_;  // [v][u]
};

/// Sum of value noise over octaves: `amplitudes[k]` at a wavelength of 2^k texels.
[[nodiscard]] std::vector<float> octave_noise(std::uint64_t seed,
                                              const std::vector<double>& amplitudes);

/// What every material and the sky are painted from.
struct Textures {
  explicit Textures(std::uint64_t seed);

  Ripmap grain;  ///< fine grains on a little of everything coarser: asphalt, plaster, stone
  Ripmap leaf;   ///< clumps with dark gaps: leaves, grass
  std::vector<float> ridge_rad;  ///< height of the hills around the horizon
};

}  // namespace stemvo::synth
