// SPDX-License-Identifier: MIT
#include <algorithm>

#include "synth/materials.hpp"

namespace stemvo::synth {
namespace {

constexpr float kPlinth_m = 0.6F;
constexpr float kFloor_m = 2.9F;

/// What all windows of one house have in common.
struct WindowPlan {
  int columns;
  float spacing;
  float width;
  float height;
  bool has_shutters;
  int door_column;

  explicit WindowPlan(const Style& style) {
    Draw draw(style.seed, 'w');
    columns = std::max(1, static_cast<int>(style.size[0] / draw.in_float(2.1, 3.4)));
    spacing = style.size[0] / static_cast<float>(columns);
    width = std::min(draw.in_float(0.9, 1.5), 0.6F * spacing);
    height = draw.in_float(1.15, 1.6);
    has_shutters = draw.chance(0.35);
    door_column = static_cast<int>(draw.next() * columns);
  }
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

Rgb plaster(const Sample& at, float, float) {
  const auto shift = static_cast<float>(at.style.seed % 61U);
  const float tone = 1.0F + 0.05F * at.grain(0.015F, shift) + 0.06F * at.grain(0.06F, shift);
  const float plinth = box_coverage(at.v, at.width_v, -10.0F, kPlinth_m);
  const float dirt = 0.12F * std::clamp(1.5F - 0.8F * at.v, 0.0F, 1.0F);
  return scaled(at.style.albedo, tone * (1.0F - dirt) * (1.0F - 0.35F * plinth));
}

Rgb facade(const Sample& at, float, float) {
  const WindowPlan plan(at.style);
  const int floors =
      std::max(1, static_cast<int>(std::lround((at.style.size[1] - kPlinth_m) / kFloor_m)));
  const int column = std::clamp(static_cast<int>(at.u / plan.spacing), 0, plan.columns - 1);
  const int floor =
      std::clamp(static_cast<int>(std::floor((at.v - kPlinth_m) / kFloor_m)), 0, floors - 1);
  Sample cell = at;
  cell.u -= plan.spacing * static_cast<float>(column);
  cell.v -= kPlinth_m + kFloor_m * static_cast<float>(floor);
  return opening(plaster(at, 0.0F, 0.0F), plan, cell, column, floor);
}

}  // namespace

namespace materials {

const Material kFacade = {facade};
const Material kPlainWall = {plaster};

}  // namespace materials
}  // namespace stemvo::synth
