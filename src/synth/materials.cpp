// SPDX-License-Identifier: MIT
#include "synth/materials.hpp"

#include <algorithm>

namespace stemvo::synth {
namespace {

/// Mended rectangles: one in three stretches of 7.68 m has one, a little darker or lighter.
float patch_tone(const Sample& at) {
  constexpr float kStretch_m = 7.68F;
  const float stretch = std::floor(at.u / kStretch_m);
  Draw draw(at.style.seed, 'm', static_cast<int>(stretch) & 7);
  if (draw.chance(0.65)) {
    return 0.0F;
  }
  const float begin_u = draw.in_float(0.2, 3.0);
  const float begin_v = draw.in_float(-5.0, 1.0);
  const float length = draw.in_float(1.0, 4.5);
  const float breadth = draw.in_float(0.6, 1.8);
  const float tone = draw.in_float(-0.08, 0.04);
  const float u = at.u - kStretch_m * stretch;
  return tone * box_coverage(u, at.width_u, begin_u, begin_u + length) *
         box_coverage(at.v, at.width_v, begin_v, begin_v + breadth);
}

/// Deviations are calibrated to the real clip (docs/synthetic_drives.md).
Rgb asphalt(const Sample& at, float, float) {
  constexpr float kGrain = 0.18F;
  constexpr float kMottle = 0.03F;
  constexpr float kDashPeriod_m = 12.288F;  // a fifth of the texture's period
  const float grain = at.grain(0.01F);
  // Tyres polish two tracks 1.5 m apart in each lane.
  const float track = 0.025F * std::cos(4.19F * (at.v - 0.75F));
  const float tone =
      1.0F + kGrain * grain + kMottle * at.grain(0.06F, 7.0F) + track + patch_tone(at);
  // Worn white dashes in the middle of the road.
  const float dashes =
      box_coverage(at.v, at.width_v, -1.82F, -1.71F) * at.bars_u(kDashPeriod_m, 3.3F);
  return blend(scaled(at.style.albedo, tone), {0.62F, 0.62F, 0.60F},
               dashes * std::clamp(0.75F + 0.2F * grain, 0.0F, 1.0F));
}

/// The stone or brick under a footprint, of rows that are shifted by half a stone.
struct Stone {
  int row;
  int column;
  float joints;  ///< share of the footprint
  float footprint_share;

  Stone(const Sample& at, float length, float breadth) {
    constexpr float kJoint_m = 0.012F;
    row = static_cast<int>(std::floor(at.v / breadth));
    const float u = at.u + (row % 2 == 0 ? 0.0F : 0.5F * length);
    column = static_cast<int>(std::floor(u / length));
    joints = std::max(bars_coverage(u, at.width_u, length, kJoint_m), at.bars_v(breadth, kJoint_m));
    footprint_share = std::max(at.width_u / length, at.width_v / breadth);
  }
};

/// Of a stone, brick or board: 1 while it is larger than the footprint.
float sharpness(float footprint_share) {
  return std::clamp(2.0F - 2.0F * footprint_share, 0.0F, 1.0F);
}

Rgb paving(const Sample& at, float length, float breadth) {
  const Stone stone(at, length, breadth);
  const int period = static_cast<int>(std::lround(static_cast<float>(kTexturePeriod_m) / length));
  const int column = (stone.column % period + period) % period;
  const auto own = static_cast<float>(unit(hash_of(at.style.seed, stone.row, column)) - 0.5);
  return scaled(at.style.albedo, 1.0F + 0.12F * sharpness(stone.footprint_share) * own +
                                     0.08F * at.grain(0.01F, 3.0F) + 0.07F * at.grain(0.06F, 1.0F) -
                                     0.3F * stone.joints);
}

Rgb leaves(const Sample& at, float texel_m, float contrast) {
  const auto shift = static_cast<float>(at.style.seed % 1024U) * 0.04F;
  const float coarse = at.leaf(4.0F * texel_m, shift);
  const float tone =
      std::max(0.08F, 1.0F + contrast * (0.8F * at.leaf(texel_m, shift) + 0.5F * coarse));
  Rgb colour = scaled(at.style.albedo, tone);
  colour[0] += 0.04F * std::max(0.0F, coarse) * at.style.albedo[1];  // sunlit: yellower
  return colour;
}

Rgb kerb(const Sample& at, float, float) {
  return scaled(at.style.albedo, 1.0F + 0.12F * at.grain(0.01F, 5.0F) +
                                     0.08F * at.grain(0.06F, 2.0F) -
                                     0.4F * at.bars_u(0.96F, 0.015F));
}

Rgb roof(const Sample& at, float, float) {
  const auto shift = static_cast<float>(at.style.seed % 97U);
  return scaled(at.style.albedo,
                1.0F - 0.3F * at.bars_v(0.33F, 0.06F) - 0.18F * at.bars_u(0.25F, 0.05F) +
                    0.12F * at.grain(0.03F, shift) + 0.08F * at.grain(0.25F, shift));
}

Rgb fence(const Sample& at, float, float) {
  return scaled(at.style.albedo, 1.0F - 0.6F * at.bars_u(0.16F, 0.03F) + 0.15F * at.grain(0.02F));
}

/// For walls that are seen from a step away: grains of 3 mm, and stains.
Rgb brick(const Sample& at, float length, float height) {
  const Stone stone(at, length, height);
  const auto shift = static_cast<float>(at.style.seed % 61U);
  const float own =
      sharpness(stone.footprint_share) *
      (static_cast<float>(unit(hash_of(at.style.seed, stone.row, stone.column))) - 0.5F);
  const float stains = 0.06F * at.grain(0.03F, shift) + 0.10F * at.leaf(0.04F, shift);
  const float tone = 1.0F + 0.55F * own + 0.10F * at.grain(0.003F, shift) + stains;
  const float gray = 0.46F * (1.0F + 0.06F * at.grain(0.004F, shift) + stains);
  return blend(scaled(at.style.albedo, tone), {gray, 0.97F * gray, 0.92F * gray}, stone.joints);
}

/// Planks with streaks along them and gaps between them.
Rgb boards(const Sample& at, float width, float gap) {
  const auto board = static_cast<int>(std::floor(at.u / width));
  const float own = sharpness(at.width_u / width) *
                    (static_cast<float>(unit(hash_of(at.style.seed, board))) - 0.5F);
  Sample along = at;  // ten times as long as wide
  along.v = 0.1F * at.v + 1.7F * static_cast<float>(board);
  along.width_v = 0.1F * at.width_v;
  const auto shift = static_cast<float>(at.style.seed % 53U);
  const float tone = 1.0F + 0.5F * own + 0.16F * along.grain(0.004F, shift) +
                     0.12F * along.leaf(0.01F, shift) + 0.06F * at.grain(0.02F, shift);
  return scaled(at.style.albedo, std::max(0.1F, tone) * (1.0F - 0.75F * at.bars_u(width, gap)));
}

}  // namespace

namespace materials {

const Material kAsphalt = {asphalt};
const Material kParking = {paving, 0.24F, 0.16F};
const Material kSidewalk = {paving, 0.48F, 0.32F};
const Material kKerb = {kerb};
const Material kGrass = {leaves, 0.015F, 0.42F};
const Material kRoof = {roof};
const Material kHedge = {leaves, 0.015F, 0.75F};
const Material kNearHedge = {leaves, 0.006F, 0.6F};
const Material kFence = {fence};
const Material kBark = {leaves, 0.01F, 0.3F};
const Material kLeaves = {leaves, 0.02F, 0.75F};
const Material kBrick = {brick, 0.25F, 0.083F};
const Material kBoards = {boards, 0.13F, 0.008F};

}  // namespace materials

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

}  // namespace stemvo::synth
