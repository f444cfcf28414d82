// SPDX-License-Identifier: MIT
#include "synth/materials.hpp"

#include <algorithm>
#include <cmath>

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

/// The stone or brick under a footprint, of rows that are shifted by half a stone.
struct Stone {
  const Sample& at;
  float length;
  float breadth;
  int row = static_cast<int>(std::floor(at.v / breadth));
  float u = at.u + (row % 2 == 0 ? 0.0F : 0.5F * length);
  int column = static_cast<int>(std::floor(u / length));
  /// Share of the footprint.
  float joints = std::max(bars_coverage(u, at.width_u, length, 0.012F), at.bars_v(breadth, 0.012F));
  float footprint_share = std::max(at.width_u / length, at.width_v / breadth);
};

/// 1 while a stone, brick or board is larger than the footprint.
float sharpness(float footprint_share) {
  return std::clamp(2.0F - 2.0F * footprint_share, 0.0F, 1.0F);
}

Rgb paving(const Sample& at, float length, float breadth) {
  const Stone stone{at, length, breadth};
  const int period = static_cast<int>(std::lround(static_cast<float>(kTexturePeriod_m) / length));
  const int column = (stone.column % period + period) % period;
  const auto own = static_cast<float>(unit(hash_of(at.style.seed, stone.row, column)) - 0.5);
  return at.style.albedo *
         (1.0F + 0.12F * sharpness(stone.footprint_share) * own + 0.08F * at.grain(0.01F, 3.0F) +
          0.07F * at.grain(0.06F, 1.0F) - 0.3F * stone.joints);
}

Rgb foliage(const Sample& at, float texel_m, float contrast) {
  const auto shift = static_cast<float>(at.style.seed % 1024U) * 0.04F;
  const float coarse = at.leaf(4.0F * texel_m, shift);
  const float tone =
      std::max(0.08F, 1.0F + contrast * (0.8F * at.leaf(texel_m, shift) + 0.5F * coarse));
  Rgb colour = at.style.albedo * tone;
  colour[0] += 0.04F * std::max(0.0F, coarse) * at.style.albedo[1];  // sunlit: yellower
  return colour;
}

constexpr float kPlinth_m = 0.6F;
constexpr float kFloor_m = 2.9F;

/// All windows of one house have this in common.
struct WindowPlan {
  Draw draw;
  float length;
  int columns = std::max(1, static_cast<int>(length / draw.in_float(2.1, 3.4)));
  float spacing = length / static_cast<float>(columns);
  float width = std::min(draw.in_float(0.9, 1.5), 0.6F * spacing);
  float height = draw.in_float(1.15, 1.6);
  bool has_shutters = draw.chance(0.35);
  int door_column = static_cast<int>(draw.next() * columns);
};

/// Paints one window (or the door) of the cell whose lower left corner is the origin of `at`.
Rgb opening(const Rgb& wall, const WindowPlan& plan, const Sample& at, int column, int floor) {
  constexpr float kSill_m = 0.9F;
  constexpr float kFrame_m = 0.07F;
  Draw draw(at.style.seed, 'o', column, floor);
  const bool is_door = floor == 0 && column == plan.door_column;
  const float left = 0.5F * (plan.spacing - plan.width);
  const float right = left + plan.width;
  const float low = is_door ? -kPlinth_m : kSill_m;
  const float high = is_door ? 2.0F : kSill_m + plan.height;
  Rgb colour = wall;
  if (plan.has_shutters && !is_door) {
    const float blade = 0.45F * plan.width;
    const float slats = 0.75F + 0.25F * at.bars_v(0.12F, 0.06F);
    colour = blend(colour, {0.22F * slats, 0.26F * slats, 0.20F * slats},
                   at.area(left - blade, right + blade, low, high));
  }
  const float light = draw.in_float(0.6, 0.85);
  const Rgb white = {light, light, light};
  colour = blend(colour, white,
                 at.area(left - kFrame_m, right + kFrame_m, low - kFrame_m, high + kFrame_m));
  if (is_door) {
    const float tone = draw.in_float(0.1, 0.3);
    return blend(colour, {tone * 1.3F, tone, 0.7F * tone}, at.area(left, right, low, high));
  }
  // Glass is dark and a little brighter towards its top; a curtain or blind hides part of some.
  const float glass = draw.in_float(0.05, 0.22);
  const float curtain_m = std::max(0.0F, draw.in_float(-0.8, 0.7)) * plan.height;
  const float bright = glass * (1.0F + 0.5F * (at.v - low) / plan.height);
  const float middle = 0.5F * (left + right);
  colour = blend(colour, {0.9F * bright, bright, 1.1F * bright}, at.area(left, right, low, high));
  colour = blend(colour, {0.58F, 0.56F, 0.52F}, at.area(left, right, high - curtain_m, high));
  colour = blend(colour, white, at.area(middle - 0.03F, middle + 0.03F, low, high));
  return blend(colour, {0.5F, 0.48F, 0.46F},  // sill
               at.area(left - 0.12F, right + 0.12F, low - 0.16F, low - kFrame_m));
}

}  // namespace

namespace materials {

/// Deviations are calibrated to the real clip (docs/synthetic_drives.md).
Rgb asphalt(const Sample& at) {
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
  return blend(at.style.albedo * tone, {0.62F, 0.62F, 0.60F},
               dashes * std::clamp(0.75F + 0.2F * grain, 0.0F, 1.0F));
}

Rgb parking(const Sample& at) { return paving(at, 0.24F, 0.16F); }
Rgb sidewalk(const Sample& at) { return paving(at, 0.48F, 0.32F); }
Rgb grass(const Sample& at) { return foliage(at, 0.015F, 0.42F); }
Rgb hedge(const Sample& at) { return foliage(at, 0.015F, 0.75F); }
Rgb near_hedge(const Sample& at) { return foliage(at, 0.006F, 0.6F); }
Rgb bark(const Sample& at) { return foliage(at, 0.01F, 0.3F); }
Rgb leaves(const Sample& at) { return foliage(at, 0.02F, 0.75F); }

Rgb kerb(const Sample& at) {
  return at.style.albedo * (1.0F + 0.12F * at.grain(0.01F, 5.0F) + 0.08F * at.grain(0.06F, 2.0F) -
                            0.4F * at.bars_u(0.96F, 0.015F));
}

Rgb roof(const Sample& at) {
  const auto shift = static_cast<float>(at.style.seed % 97U);
  return at.style.albedo *
         (1.0F - 0.3F * at.bars_v(0.33F, 0.06F) - 0.18F * at.bars_u(0.25F, 0.05F) +
          0.12F * at.grain(0.03F, shift) + 0.08F * at.grain(0.25F, shift));
}

Rgb fence(const Sample& at) {
  return at.style.albedo * (1.0F - 0.6F * at.bars_u(0.16F, 0.03F) + 0.15F * at.grain(0.02F));
}

/// For walls that are seen from a step away: grains of 3 mm, and stains.
Rgb brick(const Sample& at) {
  const Stone stone{at, 0.25F, 0.083F};
  const auto shift = static_cast<float>(at.style.seed % 61U);
  const float own =
      sharpness(stone.footprint_share) *
      (static_cast<float>(unit(hash_of(at.style.seed, stone.row, stone.column))) - 0.5F);
  const float stains = 0.06F * at.grain(0.03F, shift) + 0.10F * at.leaf(0.04F, shift);
  const float tone = 1.0F + 0.55F * own + 0.10F * at.grain(0.003F, shift) + stains;
  const float gray = 0.46F * (1.0F + 0.06F * at.grain(0.004F, shift) + stains);
  return blend(at.style.albedo * tone, {gray, 0.97F * gray, 0.92F * gray}, stone.joints);
}

/// Planks with streaks along them and gaps between them.
Rgb boards(const Sample& at) {
  constexpr float kWidth_m = 0.13F;
  const auto board = static_cast<int>(std::floor(at.u / kWidth_m));
  const float own = sharpness(at.width_u / kWidth_m) *
                    (static_cast<float>(unit(hash_of(at.style.seed, board))) - 0.5F);
  Sample along = at;  // ten times as long as wide
  along.v = 0.1F * at.v + 1.7F * static_cast<float>(board);
  along.width_v = 0.1F * at.width_v;
  const auto shift = static_cast<float>(at.style.seed % 53U);
  const float tone = 1.0F + 0.5F * own + 0.16F * along.grain(0.004F, shift) +
                     0.12F * along.leaf(0.01F, shift) + 0.06F * at.grain(0.02F, shift);
  return at.style.albedo * (std::max(0.1F, tone) * (1.0F - 0.75F * at.bars_u(kWidth_m, 0.008F)));
}

Rgb bodywork(const Sample& at) {
  const auto shift = static_cast<float>(at.style.seed % 43U);
  const float dirt = 0.10F * at.grain(0.012F, shift) + 0.12F * at.leaf(0.03F, shift);
  return at.style.albedo *
         (1.0F + dirt - 0.7F * at.bars_u(1.05F, 0.02F) - 0.5F * at.bars_v(0.26F, 0.015F));
}

Rgb printed_sheet(const Sample& at) {
  constexpr float kField_m = 0.62F;
  constexpr float kLetter_m = 0.11F;
  const auto cell = [&](float size, int key) {
    const auto column = static_cast<int>(std::floor(at.u / size));
    const auto row = static_cast<int>(std::floor(at.v / size));
    return Draw(at.style.seed, key, column, row);
  };
  const auto sharp = [&](float size) { return sharpness(std::max(at.width_u, at.width_v) / size); };
  Draw field = cell(kField_m, 'f');
  const float tone = field.in_float(0.45, 1.35);
  Rgb colour = at.style.albedo;
  for (float& value : colour.val) {
    value *= 1.0F + sharp(kField_m) * (tone * field.in_float(0.75, 1.2) - 1.0F);
  }
  // Every second field has lines of letters.
  if (field.chance(0.5)) {
    Draw letter = cell(kLetter_m, 'l');
    const float ink = letter.chance(0.6) ? -0.75F : 0.15F;
    const float gaps = std::max(at.bars_v(kLetter_m, 0.03F), at.bars_u(kLetter_m, 0.02F));
    colour = colour * (1.0F + sharp(kLetter_m) * ink * (1.0F - gaps));
  }
  const auto shift = static_cast<float>(at.style.seed % 37U);
  return colour * (1.0F + 0.07F * at.grain(0.012F, shift) + 0.06F * at.leaf(0.04F, shift));
}

Rgb cloth(const Sample& at) {
  const auto shift = static_cast<float>(at.style.seed % 47U);
  const float stripes = (at.style.seed & 4U) != 0U ? 0.35F * at.bars_v(0.12F, 0.05F) : 0.0F;
  return at.style.albedo * (std::max(0.1F, 1.0F + 0.15F * at.grain(0.006F, shift) +
                                               0.25F * at.leaf(0.012F, shift) - stripes));
}

Rgb plain_wall(const Sample& at) {
  const auto shift = static_cast<float>(at.style.seed % 61U);
  const float tone = 1.0F + 0.05F * at.grain(0.015F, shift) + 0.06F * at.grain(0.06F, shift);
  const float plinth = box_coverage(at.v, at.width_v, -10.0F, kPlinth_m);
  const float dirt = 0.12F * std::clamp(1.5F - 0.8F * at.v, 0.0F, 1.0F);
  return at.style.albedo * (tone * (1.0F - dirt) * (1.0F - 0.35F * plinth));
}

Rgb facade(const Sample& at) {
  const WindowPlan plan{Draw(at.style.seed, 'w'), at.style.size[0]};
  const int floors =
      std::max(1, static_cast<int>(std::lround((at.style.size[1] - kPlinth_m) / kFloor_m)));
  const int column = std::clamp(static_cast<int>(at.u / plan.spacing), 0, plan.columns - 1);
  const int floor =
      std::clamp(static_cast<int>(std::floor((at.v - kPlinth_m) / kFloor_m)), 0, floors - 1);
  Sample cell = at;
  cell.u -= plan.spacing * static_cast<float>(column);
  cell.v -= kPlinth_m + kFloor_m * static_cast<float>(floor);
  return opening(plain_wall(at), plan, cell, column, floor);
}

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

float smooth_step(float begin, float end, float x) {
  const float t = std::clamp((x - begin) / (end - begin), 0.0F, 1.0F);
  return t * t * (3.0F - 2.0F * t);
}

}  // namespace stemvo::synth
