// SPDX-License-Identifier: MIT
#include "synth/vehicles.hpp"

#include <algorithm>
#include <span>

#include "synth/materials.hpp"

namespace stemvo::synth {
namespace {

/// A box in a thing's own axes: along, to the right, up from the middle of its rear end; metres.
struct Part {
  Rgb albedo;
  Vec3 corner;
  Vec3 size;
  Material material = nullptr;
};

constexpr Rgb kTyre = {0.03F, 0.03F, 0.03F};
constexpr Rgb kTailLamp = {0.6F, 0.12F, 0.1F};
constexpr Rgb kHeadLamp = {0.8F, 0.8F, 0.76F};
constexpr Rgb kGlass = {0.07F, 0.08F, 0.09F};
constexpr Rgb kPlate = {0.85F, 0.85F, 0.82F};
constexpr Rgb kShadow = {0.07F, 0.07F, 0.075F};  // what the sky cannot reach

void add_parts(const RoadFrame& axes,
               const Vec3& origin,
               std::span<const Part> parts,
               const Style& common,
               Scene& scene) {
  Style style = common;
  for (const Part& part : parts) {
    const Vec3 at = origin + part.corner.x() * axes.forward + part.corner.y() * axes.right +
                    part.corner.z() * axes.up;
    style.albedo = part.albedo;
    style.material = part.material;
    scene.add_box(
        at, {part.size.x() * axes.forward, part.size.y() * axes.right, part.size.z() * axes.up},
        style);
  }
}

/// A thin dark mat.
Part shadow(double length_m, double width_m) {
  return {kShadow, {-0.1, -0.1 - 0.5 * width_m, 0.0}, {length_m + 0.2, width_m + 0.2, 0.015}};
}

struct CarPlan {
  Rgb paint;
  std::uint32_t seed;
  double width;
  double length;

  explicit CarPlan(Draw& draw) {
    const float gray = draw.in_float(0.05, 0.75);
    const float tint = draw.in_float(-0.12, 0.12);
    paint = {gray + std::max(tint, 0.0F), gray, gray + std::max(-tint, 0.0F)};
    seed = draw.bits();
    width = draw.in(1.65, 1.8);
    length = draw.in(3.9, 4.7);
  }

  [[nodiscard]] std::array<Part, 9> parts(Material body) const {
    const auto across = [&](double right_of_left_side) { return right_of_left_side - 0.5 * width; };
    return {{
        {paint, {0.0, across(0.0), 0.3}, {length, width, 0.52}, body},
        {kGlass, {0.12 * length, across(0.09), 0.82}, {0.55 * length, width - 0.18, 0.5}},
        {paint, {0.2 * length, across(0.12), 1.32}, {0.38 * length, width - 0.24, 0.1}, body},
        {kTyre, {0.12 * length, across(-0.02), 0.0}, {0.6, width + 0.04, 0.58}},
        {kTyre, {0.72 * length, across(-0.02), 0.0}, {0.6, width + 0.04, 0.58}},
        {kTailLamp, {-0.02, across(0.05), 0.62}, {0.02, 0.3, 0.14}},
        {kTailLamp, {-0.02, across(width - 0.35), 0.62}, {0.02, 0.3, 0.14}},
        {kPlate, {-0.02, across(0.5 * width - 0.26), 0.5}, {0.02, 0.52, 0.11}},
        {kShadow, {-0.1, across(-0.1), 0.0}, {length + 0.2, width + 0.2, 0.015}},
    }};
  }
};

Rgb any_paint(Draw& draw) {
  const float light = draw.in_float(0.25, 0.8);
  const float red = draw.in_float(0.4, 1.1);
  const float green = draw.in_float(0.4, 1.1);
  const float blue = draw.in_float(0.4, 1.1);
  return {light * red, light * green, light * blue};
}

}  // namespace

void add_parked_car(const RoadFrame& place, Draw draw, Scene& scene) {
  constexpr double kLateral_m = 3.35;
  const CarPlan plan(draw);
  add_parts(place, place.point(kLateral_m, 0.0), plan.parts(nullptr), {.seed = plan.seed}, scene);
}

void add_car(const RoadFrame& at, Draw draw, bool moves, Scene& scene) {
  const CarPlan plan(draw);
  const Style common{.seed = plan.seed, .moves = moves};
  add_parts(at, at.position, plan.parts(materials::bodywork), common, scene);
  const double front = plan.length;
  const double side = 0.5 * plan.width;
  const std::array<Part, 3> face = {
      {{kHeadLamp, {front, 0.05 - side, 0.58}, {0.02, 0.36, 0.16}},
       {kHeadLamp, {front, side - 0.41, 0.58}, {0.02, 0.36, 0.16}},
       {kTyre, {front, 0.45 - side, 0.45}, {0.015, plan.width - 0.9, 0.2}}}};
  add_parts(at, at.position, face, common, scene);
}

void add_lorry(const RoadFrame& at, Draw draw, bool moves, Scene& scene) {
  constexpr double kWidth_m = 2.5;
  constexpr double kCab_m = 1.9;
  constexpr double kLoad_m = kLorryLength_m - kCab_m - 0.3;
  constexpr double kLeft_m = -0.5 * kWidth_m;
  constexpr double kCabAt_m = kLorryLength_m - kCab_m;
  const Rgb sheet = any_paint(draw);
  const Rgb cab = any_paint(draw);
  const double height_m = draw.in(2.3, 2.8);
  const Style common{.seed = draw.bits(), .moves = moves};
  const std::array<Part, 13> parts = {{
      {sheet, {0.0, kLeft_m, 1.0}, {kLoad_m, kWidth_m, height_m}, materials::printed_sheet},
      {{0.1F, 0.1F, 0.1F}, {0.2, kLeft_m + 0.5, 0.6}, {kLorryLength_m - 0.4, 1.5, 0.4}},
      {cab, {kCabAt_m, kLeft_m + 0.05, 0.5}, {kCab_m, kWidth_m - 0.1, 2.3}, materials::bodywork},
      {kGlass, {kLorryLength_m, kLeft_m + 0.2, 1.6}, {0.02, kWidth_m - 0.4, 0.9}},
      {kGlass, {kCabAt_m + 0.7, kLeft_m + 0.04, 1.6}, {0.8, kWidth_m - 0.08, 0.8}},
      {kHeadLamp, {kLorryLength_m, kLeft_m + 0.15, 0.7}, {0.02, 0.4, 0.22}},
      {kHeadLamp, {kLorryLength_m, -kLeft_m - 0.55, 0.7}, {0.02, 0.4, 0.22}},
      {kTyre, {0.5, kLeft_m, 0.0}, {1.0, kWidth_m, 0.95}},
      {kTyre, {1.7, kLeft_m, 0.0}, {1.0, kWidth_m, 0.95}},
      {kTyre, {kCabAt_m + 0.4, kLeft_m, 0.0}, {1.0, kWidth_m, 0.95}},
      {kTailLamp, {-0.02, kLeft_m + 0.1, 0.75}, {0.02, 0.45, 0.16}},
      {kTailLamp, {-0.02, -kLeft_m - 0.55, 0.75}, {0.02, 0.45, 0.16}},
      shadow(kLorryLength_m, kWidth_m),
  }};
  add_parts(at, at.position, parts, common, scene);
}

void add_person(const RoadFrame& at, Draw draw, double stride_rad, bool moves, Scene& scene) {
  const double tall = draw.in(0.92, 1.08);
  const Rgb coat = any_paint(draw);
  const Rgb trousers = scaled(any_paint(draw), 0.5F);
  const Style common{.seed = draw.bits(), .moves = moves};
  const Rgb skin = {0.5F, 0.36F, 0.28F};
  const std::array<Part, 3> body = {{
      {coat, {-0.12, -0.22, 0.82 * tall}, {0.24, 0.44, 0.62 * tall}, materials::cloth},
      {skin, {-0.1, -0.09, 1.48 * tall}, {0.2, 0.18, 0.25}, materials::cloth},
      shadow(0.3, 0.35),
  }};
  add_parts(at, at.position, body, common, scene);
  // Legs and arms lean forward and back by turns.
  const double swing_m = 0.3 * std::sin(stride_rad);
  const auto add_limb = [&](double side_m, double top_m, double length_m, double reach_m,
                            const Rgb& colour, double width_m) {
    Style style = common;
    style.albedo = colour;
    style.material = materials::cloth;
    const Vec3 foot = at.position + (reach_m - 0.5 * width_m) * at.forward +
                      (side_m - 0.5 * width_m) * at.right + (top_m - length_m) * at.up;
    scene.add_box(
        foot, {width_m * at.forward, width_m * at.right, length_m * at.up - reach_m * at.forward},
        style);
  };
  add_limb(-0.11, 0.85 * tall, 0.84 * tall, swing_m, trousers, 0.16);
  add_limb(0.11, 0.85 * tall, 0.84 * tall, -swing_m, trousers, 0.16);
  add_limb(-0.28, 1.4 * tall, 0.6 * tall, -swing_m, coat, 0.1);
  add_limb(0.28, 1.4 * tall, 0.6 * tall, swing_m, coat, 0.1);
}

}  // namespace stemvo::synth
