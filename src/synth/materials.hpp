// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <opencv2/core.hpp>

#include "synth/scene.hpp"

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

  std::array<std::array<cv::Mat, kLevels>, kLevels> levels_;  // [v][u]
};

/// Every material and the sky are painted from these.
struct Textures {
  explicit Textures(std::uint64_t seed);

  Ripmap grain;  ///< fine grains on a little of everything coarser: asphalt, plaster, stone
  Ripmap leaf;   ///< clumps with dark gaps: leaves, grass
  std::vector<float> ridge_rad;  ///< height of the hills around the horizon
};

/// Texture coordinates along a road start anew at multiples of this: float stays exact.
inline constexpr double kTexturePeriod_m = 61.44;

/// Share of the footprint [x - width/2, x + width/2] inside [begin, end].
[[nodiscard]] float box_coverage(float x, float width, float begin, float end);
/// The same for bars [k * period, k * period + bar] of all integers k.
[[nodiscard]] float bars_coverage(float x, float width, float period, float bar);

/// A pixel's footprint on a face: its middle and its size, in metres of the face's texture
/// coordinates. u runs along a road or a wall, v across the road or up.
struct Sample {
  const Style& style;
  const Textures& textures;
  float u = 0.0F;
  float v = 0.0F;
  float width_u = 0.0F;
  float width_v = 0.0F;

  /// Noise at `texel_m` metres per texel. `texel_m` * Ripmap::kSize should divide kTexturePeriod_m
  /// for the noise on roads to go on where u starts anew.
  [[nodiscard]] float grain(float texel_m, float shift = 0.0F) const {
    return noise(textures.grain, texel_m, shift);
  }
  [[nodiscard]] float leaf(float texel_m, float shift) const {
    return noise(textures.leaf, texel_m, shift);
  }
  /// Share of the footprint on bars that cross u, or v.
  [[nodiscard]] float bars_u(float period, float bar) const {
    return bars_coverage(u, width_u, period, bar);
  }
  [[nodiscard]] float bars_v(float period, float bar) const {
    return bars_coverage(v, width_v, period, bar);
  }
  [[nodiscard]] float area(float left, float right, float low, float high) const {
    return box_coverage(u, width_u, left, right) * box_coverage(v, width_v, low, high);
  }

 private:
  [[nodiscard]] float noise(const Ripmap& tile, float texel_m, float shift) const {
    const float s = 1.0F / texel_m;
    return tile.sample((u + shift) * s, (v + shift) * s, width_u * s, width_v * s);
  }
};

/// Colour of the air.
inline const Rgb kHaze = {0.60F, 0.63F, 0.66F};

/// The backdrop: blue with thin clouds, wooded hills on the horizon, fields below it. It is
/// infinitely far and moves with the camera's rotation only. `direction` in world axes (-y up), any
/// length; `pixel_rad` is the angle of one pixel.
[[nodiscard]] Rgb sky_colour(const Vec3& direction, double pixel_rad, const Textures& textures);

[[nodiscard]] float smooth_step(float begin, float end, float x);

namespace materials {

Rgb asphalt(const Sample& at);
Rgb parking(const Sample& at);  // small paving stones
Rgb sidewalk(const Sample& at);
Rgb kerb(const Sample& at);
Rgb grass(const Sample& at);
Rgb facade(const Sample& at);  // a front with a plinth, rows of windows and one door
Rgb plain_wall(const Sample& at);
Rgb roof(const Sample& at);
Rgb hedge(const Sample& at);
Rgb near_hedge(const Sample& at);  // seen from a step away
Rgb fence(const Sample& at);
Rgb bark(const Sample& at);
Rgb leaves(const Sample& at);
Rgb brick(const Sample& at);
Rgb boards(const Sample& at);         // upright planks
Rgb bodywork(const Sample& at);       // a car's sides: panels, dirt
Rgb printed_sheet(const Sample& at);  // a lorry's sides: fields of colours and writing
Rgb cloth(const Sample& at);

}  // namespace materials
}  // namespace stemvo::synth
