// SPDX-License-Identifier: MIT
#include "dataset/synth/facade.hpp"

#include <algorithm>
#include <cmath>

#include "dataset/synth/hash.hpp"

namespace stemvo::synth {
namespace {

constexpr float kPlinth_m = 0.6F;
constexpr float kFloor_m = 2.9F;

Rgb blend(const Rgb& from, const Rgb& to, float share) {
  return {from[0] + share * (to[0] - from[0]), from[1] + share * (to[1] - from[1]),
          from[2] + share * (to[2] - from[2])};
}

/// What all windows of one house have in common.
struct WindowPlan {
  int columns = 1;
  float spacing = 1.0F;
  float width = 1.0F;
  float height = 1.4F;
  float sill = 0.9F;
  bool has_shutters = false;
  int door_column = 0;

  explicit WindowPlan(const Style& style) {
    Draw draw(style.seed, 'w');
    const auto wanted = static_cast<float>(draw.in(2.1, 3.4));
    columns = std::max(1, static_cast<int>(style.size[0] / wanted));
    spacing = style.size[0] / static_cast<float>(columns);
    width = std::min(static_cast<float>(draw.in(0.9, 1.5)), 0.6F * spacing);
    height = static_cast<float>(draw.in(1.15, 1.6));
    has_shutters = draw.chance(0.35);
    door_column = static_cast<int>(draw.next() * columns);
  }
};

float area(const Footprint& at, float left, float right, float low, float high) {
  return box_coverage(at.u, at.width_u, left, right) * box_coverage(at.v, at.width_v, low, high);
}

/// Paints one window (or the door) of the cell whose lower left corner is the origin of `at`.
Rgb opening(const Rgb& wall,
            const Style& style,
            const WindowPlan& plan,
            const Footprint& at,
            int column,
            int floor) {
  Draw draw(style.seed, 'o', column, floor);
  const bool is_door = floor == 0 && column == plan.door_column;
  const float left = 0.5F * (plan.spacing - plan.width);
  const float right = left + plan.width;
  const float low = is_door ? -kPlinth_m : plan.sill;
  const float high = is_door ? 2.0F : plan.sill + plan.height;
  constexpr float kFrame_m = 0.07F;
  Rgb colour = wall;
  if (plan.has_shutters && !is_door) {
    const float blade = 0.45F * plan.width;
    const float share = area(at, left - blade, right + blade, low, high);
    const float slats = 0.75F + 0.25F * bars_coverage(at.v, at.width_v, 0.12F, 0.06F);
    colour = blend(colour, {0.22F * slats, 0.26F * slats, 0.20F * slats}, share);
  }
  const auto white = static_cast<float>(draw.in(0.6, 0.85));
  colour = blend(colour, {white, white, white},
                 area(at, left - kFrame_m, right + kFrame_m, low - kFrame_m, high + kFrame_m));
  if (is_door) {
    const auto tone = static_cast<float>(draw.in(0.1, 0.3));
    return blend(colour, {tone * 1.3F, tone, 0.7F * tone}, area(at, left, right, low, high));
  }
  // Glass is dark and a little brighter towards its top; a curtain or blind hides part of some.
  const auto glass = static_cast<float>(draw.in(0.05, 0.22));
  const auto curtain_m = static_cast<float>(std::max(0.0, draw.in(-0.8, 0.7))) * plan.height;
  const float bright = glass * (1.0F + 0.5F * (at.v - low) / plan.height);
  colour = blend(colour, {0.9F * bright, bright, 1.1F * bright}, area(at, left, right, low, high));
  colour = blend(colour, {0.58F, 0.56F, 0.52F}, area(at, left, right, high - curtain_m, high));
  const float middle = 0.5F * (left + right);
  colour =
      blend(colour, {white, white, white}, area(at, middle - 0.03F, middle + 0.03F, low, high));
  return blend(colour, {0.5F, 0.48F, 0.46F},  // sill
               area(at, left - 0.12F, right + 0.12F, low - 0.16F, low - kFrame_m));
}

}  // namespace

Rgb plaster(const Style& style, const Footprint& at, const Textures& textures) {
  const auto shift = static_cast<float>(style.seed % 61U);
  const auto noise = [&](float texel_m) {
    const float s = 1.0F / texel_m;
    return textures.grain.sample((at.u + shift) * s, (at.v + shift) * s, at.width_u * s,
                                 at.width_v * s);
  };
  const float tone = 1.0F + 0.05F * noise(0.015F) + 0.06F * noise(0.06F);
  const float plinth = box_coverage(at.v, at.width_v, -10.0F, kPlinth_m);
  const float dirt = 0.12F * std::clamp(1.5F - 0.8F * at.v, 0.0F, 1.0F);
  const float factor = tone * (1.0F - dirt) * (1.0F - 0.35F * plinth);
  return {style.albedo[0] * factor, style.albedo[1] * factor, style.albedo[2] * factor};
}

Rgb facade(const Style& style, const Footprint& at, const Textures& textures) {
  const WindowPlan plan(style);
  const Rgb wall = plaster(style, at, textures);
  const int floors =
      std::max(1, static_cast<int>(std::lround((style.size[1] - kPlinth_m) / kFloor_m)));
  const int column = std::clamp(static_cast<int>(at.u / plan.spacing), 0, plan.columns - 1);
  const int floor =
      std::clamp(static_cast<int>(std::floor((at.v - kPlinth_m) / kFloor_m)), 0, floors - 1);
  Footprint cell = at;
  cell.u -= plan.spacing * static_cast<float>(column);
  cell.v -= kPlinth_m + kFloor_m * static_cast<float>(floor);
  return opening(wall, style, plan, cell, column, floor);
}

}  // namespace stemvo::synth
