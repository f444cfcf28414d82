// SPDX-License-Identifier: MIT
#pragma once

#include "synth/ripmap.hpp"
#include "synth/scene.hpp"

namespace stemvo::synth {

/// Texture coordinates along a road start anew at multiples of this: float stays exact.
inline constexpr double kTexturePeriod_m = 61.44;

/// Share of the footprint [x - width/2, x + width/2] inside [begin, end].
[[nodiscard]] float box_coverage(float x, float width, float begin, float end);
/// The same for bars [k * period, k * period + bar] of all integers k.
[[nodiscard]] float bars_coverage(float x, float width, float period, float bar);

/// What one pixel sees of a face of some style: the middle of its footprint and the footprint's
/// size, in metres of the face's texture coordinates. u runs along a road or a wall, v across the
/// road or up.
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
  /// Share of the footprint in a rectangle.
  [[nodiscard]] float area(float left, float right, float low, float high) const {
    return box_coverage(u, width_u, left, right) * box_coverage(v, width_v, low, high);
  }

 private:
  [[nodiscard]] float noise(const Ripmap& tile, float texel_m, float shift) const {
    const float s = 1.0F / texel_m;
    return tile.sample((u + shift) * s, (v + shift) * s, width_u * s, width_v * s);
  }
};

/// Mean colour over a footprint, before light and haze, by two numbers of the material.
struct Material {
  Rgb (*paint)(const Sample& at, float a, float b);
  float a = 0.0F;
  float b = 0.0F;
};

/// Colour of the air.
inline constexpr Rgb kHaze = {0.60F, 0.63F, 0.66F};

/// What is infinitely far: blue with thin clouds, wooded hills on the horizon, fields below it. It
/// moves with the camera's rotation only. `direction` in world axes (-y up), any length;
/// `pixel_rad` is the angle of one pixel.
[[nodiscard]] Rgb sky_colour(const Vec3& direction, double pixel_rad, const Textures& textures);

[[nodiscard]] float smooth_step(float begin, float end, float x);

namespace materials {

extern const Material kAsphalt;
extern const Material kParking;  // small paving stones
extern const Material kSidewalk;
extern const Material kKerb;
extern const Material kGrass;
extern const Material kFacade;  // a front with a plinth, rows of windows and one door
extern const Material kPlainWall;
extern const Material kRoof;
extern const Material kHedge;
extern const Material kNearHedge;  // one that is looked at from a step away
extern const Material kFence;
extern const Material kBark;
extern const Material kLeaves;
extern const Material kBrick;
extern const Material kBoards;  // upright planks

}  // namespace materials
}  // namespace stemvo::synth
