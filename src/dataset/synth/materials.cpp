// SPDX-License-Identifier: MIT
#include "dataset/synth/materials.hpp"

#include <algorithm>
#include <cmath>

#include "dataset/synth/facade.hpp"
#include "dataset/synth/hash.hpp"

namespace stemvo::synth {
namespace {

/// Noise at `texel_m` metres per texel. `texel_m` * Ripmap::kSize should divide kTexturePeriod_m
/// for the noise on roads to go on where u starts anew.
float noise(const Ripmap& tile, const Footprint& at, float texel_m, float shift = 0.0F) {
  const float s = 1.0F / texel_m;
  return tile.sample((at.u + shift) * s, (at.v + shift) * s, at.width_u * s, at.width_v * s);
}

Rgb scaled(const Rgb& colour, float factor) {
  return {colour[0] * factor, colour[1] * factor, colour[2] * factor};
}

Rgb blend(const Rgb& from, const Rgb& to, float share) {
  return {from[0] + share * (to[0] - from[0]), from[1] + share * (to[1] - from[1]),
          from[2] + share * (to[2] - from[2])};
}

/// Worn white dashes in the middle of the road.
float lane_marking(const Footprint& at) {
  constexpr float kDashPeriod_m = 12.288F;  // a fifth of the texture's period
  return box_coverage(at.v, at.width_v, -1.82F, -1.71F) *
         bars_coverage(at.u, at.width_u, kDashPeriod_m, 3.3F);
}

/// Mended rectangles: one in three stretches of 7.68 m has one, a little darker or lighter.
float patch_tone(const Style& style, const Footprint& at) {
  constexpr float kStretch_m = 7.68F;
  const float stretch = std::floor(at.u / kStretch_m);
  Draw draw(style.seed, 'm', static_cast<int>(stretch) & 7);
  if (draw.chance(0.65)) {
    return 0.0F;
  }
  const auto begin_u = static_cast<float>(draw.in(0.2, 3.0));
  const auto begin_v = static_cast<float>(draw.in(-5.0, 1.0));
  const auto length = static_cast<float>(draw.in(1.0, 4.5));
  const auto breadth = static_cast<float>(draw.in(0.6, 1.8));
  const auto tone = static_cast<float>(draw.in(-0.08, 0.04));
  const float u = at.u - kStretch_m * stretch;
  return tone * box_coverage(u, at.width_u, begin_u, begin_u + length) *
         box_coverage(at.v, at.width_v, begin_v, begin_v + breadth);
}

/// Deviations are calibrated to the real clip (docs/synthetic_drives.md).
Rgb asphalt(const Style& style, const Footprint& at, const Textures& textures) {
  constexpr float kGrain = 0.18F;
  constexpr float kMottle = 0.03F;
  const float grain = noise(textures.grain, at, 0.01F);
  const float mottle = noise(textures.grain, at, 0.06F, 7.0F);
  // Tyres polish two tracks 1.5 m apart in each lane.
  const float track = 0.025F * std::cos(4.19F * (at.v - 0.75F));
  const float tone = 1.0F + kGrain * grain + kMottle * mottle + track + patch_tone(style, at);
  const float paint_share = lane_marking(at) * std::clamp(0.75F + 0.2F * grain, 0.0F, 1.0F);
  return blend(scaled(style.albedo, tone), {0.62F, 0.62F, 0.60F}, paint_share);
}

/// Stones of `length` x `breadth` with joints; each stone has its own tone while it is larger than
/// the footprint.
Rgb paving(const Style& style,
           const Footprint& at,
           const Textures& textures,
           float length,
           float breadth) {
  constexpr float kJoint_m = 0.012F;
  const float row = std::floor(at.v / breadth);
  const float u = at.u + (static_cast<int>(row) % 2 == 0 ? 0.0F : 0.5F * length);
  const float joints = std::max(bars_coverage(u, at.width_u, length, kJoint_m),
                                bars_coverage(at.v, at.width_v, breadth, kJoint_m));
  const int period = static_cast<int>(std::lround(static_cast<float>(kTexturePeriod_m) / length));
  const int column = static_cast<int>(std::floor(u / length)) % period;
  const auto own = static_cast<float>(
      unit(hash_of(style.seed, static_cast<int>(row), column < 0 ? column + period : column)) -
      0.5);
  const float sharp =
      std::clamp(2.0F - 2.0F * std::max(at.width_u / length, at.width_v / breadth), 0.0F, 1.0F);
  const float tone = 1.0F + 0.12F * sharp * own + 0.08F * noise(textures.grain, at, 0.01F, 3.0F) +
                     0.07F * noise(textures.grain, at, 0.06F, 1.0F) - 0.3F * joints;
  return scaled(style.albedo, tone);
}

Rgb leaves(const Style& style,
           const Footprint& at,
           const Textures& textures,
           float texel_m,
           float contrast) {
  const auto shift = static_cast<float>(style.seed % 1024U) * 0.04F;
  const float fine = noise(textures.leaf, at, texel_m, shift);
  const float coarse = noise(textures.leaf, at, 4.0F * texel_m, shift);
  const float tone = std::max(0.08F, 1.0F + contrast * (0.8F * fine + 0.5F * coarse));
  Rgb colour = scaled(style.albedo, tone);
  colour[0] += 0.04F * std::max(0.0F, coarse) * style.albedo[1];  // sunlit leaves are yellower
  return colour;
}

Rgb kerb(const Style& style, const Footprint& at, const Textures& textures) {
  const float joints = bars_coverage(at.u, at.width_u, 0.96F, 0.015F);
  return scaled(style.albedo, 1.0F + 0.12F * noise(textures.grain, at, 0.01F, 5.0F) +
                                  0.08F * noise(textures.grain, at, 0.06F, 2.0F) - 0.4F * joints);
}

Rgb roof(const Style& style, const Footprint& at, const Textures& textures) {
  const float rows = bars_coverage(at.v, at.width_v, 0.33F, 0.06F);
  const float columns = bars_coverage(at.u, at.width_u, 0.25F, 0.05F);
  const auto shift = static_cast<float>(style.seed % 97U);
  return scaled(style.albedo, 1.0F - 0.3F * rows - 0.18F * columns +
                                  0.12F * noise(textures.grain, at, 0.03F, shift) +
                                  0.08F * noise(textures.grain, at, 0.25F, shift));
}

Rgb fence(const Style& style, const Footprint& at, const Textures& textures) {
  const float gaps = bars_coverage(at.u, at.width_u, 0.16F, 0.03F);
  return scaled(style.albedo, 1.0F - 0.6F * gaps + 0.15F * noise(textures.grain, at, 0.02F));
}

/// Each brick and each board has its own tone while it is larger than the footprint.
float own_tone(std::uint64_t hash, float footprint_share) {
  const float sharp = std::clamp(2.0F - 2.0F * footprint_share, 0.0F, 1.0F);
  return sharp * (static_cast<float>(unit(hash)) - 0.5F);
}

/// For walls that are looked at from a step away: grains of 3 mm, and stains.
Rgb brick(const Style& style, const Footprint& at, const Textures& textures) {
  constexpr float kLength_m = 0.25F;
  constexpr float kHeight_m = 0.083F;
  constexpr float kMortar_m = 0.012F;
  const auto row = static_cast<int>(std::floor(at.v / kHeight_m));
  const float u = at.u + (row % 2 == 0 ? 0.0F : 0.5F * kLength_m);
  const auto column = static_cast<int>(std::floor(u / kLength_m));
  const float mortar = std::max(bars_coverage(u, at.width_u, kLength_m, kMortar_m),
                                bars_coverage(at.v, at.width_v, kHeight_m, kMortar_m));
  const auto shift = static_cast<float>(style.seed % 61U);
  const float own = own_tone(hash_of(style.seed, row, column),
                             std::max(at.width_u / kLength_m, at.width_v / kHeight_m));
  const float stains = 0.06F * noise(textures.grain, at, 0.03F, shift) +
                       0.10F * noise(textures.leaf, at, 0.04F, shift);
  const float tone = 1.0F + 0.55F * own + 0.10F * noise(textures.grain, at, 0.003F, shift) + stains;
  const float gray = 0.46F * (1.0F + 0.06F * noise(textures.grain, at, 0.004F, shift) + stains);
  return blend(scaled(style.albedo, tone), {gray, 0.97F * gray, 0.92F * gray}, mortar);
}

/// Planks of 13 cm with streaks along them and gaps between them.
Rgb boards(const Style& style, const Footprint& at, const Textures& textures) {
  constexpr float kWidth_m = 0.13F;
  const float gaps = bars_coverage(at.u, at.width_u, kWidth_m, 0.008F);
  const auto board = static_cast<int>(std::floor(at.u / kWidth_m));
  const float own = own_tone(hash_of(style.seed, board), at.width_u / kWidth_m);
  Footprint along = at;  // ten times as long as wide
  along.v = 0.1F * at.v + 1.7F * static_cast<float>(board);
  along.width_v = 0.1F * at.width_v;
  const auto shift = static_cast<float>(style.seed % 53U);
  const float tone = 1.0F + 0.5F * own + 0.16F * noise(textures.grain, along, 0.004F, shift) +
                     0.12F * noise(textures.leaf, along, 0.01F, shift) +
                     0.06F * noise(textures.grain, at, 0.02F, shift);
  return scaled(style.albedo, std::max(0.1F, tone) * (1.0F - 0.75F * gaps));
}

}  // namespace

float box_coverage(float x, float width, float begin, float end) {
  const float w = std::max(width, 1e-6F);
  const float inside = std::min(x + 0.5F * w, end) - std::max(x - 0.5F * w, begin);
  return std::clamp(inside / w, 0.0F, 1.0F);
}

float bars_coverage(float x, float width, float period, float bar) {
  const float w = std::max(width, 1e-6F);
  const auto integral = [&](float t) {  // length of bar in [0, t)
    const float k = std::floor(t / period);
    return k * bar + std::min(t - k * period, bar);
  };
  // Counted from the cell of x, so that the difference of two long lengths loses nothing.
  const float local = x - period * std::floor(x / period);
  return std::clamp((integral(local + 0.5F * w) - integral(local - 0.5F * w)) / w, 0.0F, 1.0F);
}

Rgb paint(const Style& style, const Footprint& at, const Textures& textures) {
  switch (style.material) {
    case Material::kAsphalt:
      return asphalt(style, at, textures);
    case Material::kParking:
      return paving(style, at, textures, 0.24F, 0.16F);
    case Material::kSidewalk:
      return paving(style, at, textures, 0.48F, 0.32F);
    case Material::kKerb:
      return kerb(style, at, textures);
    case Material::kGrass:
      return leaves(style, at, textures, 0.015F, 0.42F);
    case Material::kFacade:
      return facade(style, at, textures);
    case Material::kPlainWall:
      return plaster(style, at, textures);
    case Material::kRoof:
      return roof(style, at, textures);
    case Material::kHedge:
      return leaves(style, at, textures, 0.015F, 0.75F);
    case Material::kNearHedge:
      return leaves(style, at, textures, 0.006F, 0.6F);
    case Material::kFence:
      return fence(style, at, textures);
    case Material::kBark:
      return leaves(style, at, textures, 0.01F, 0.3F);
    case Material::kLeaves:
      return leaves(style, at, textures, 0.02F, 0.75F);
    case Material::kBrick:
      return brick(style, at, textures);
    case Material::kBoards:
      return boards(style, at, textures);
    case Material::kPaint:
      break;
  }
  return style.albedo;
}

}  // namespace stemvo::synth
