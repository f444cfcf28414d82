// SPDX-License-Identifier: MIT
#include "synth/objects.hpp"

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
  double lean_m = 0.0;  ///< its top is so far behind its foot
};

const Rgb kTyre = {0.03F, 0.03F, 0.03F};
const Rgb kTailLamp = {0.6F, 0.12F, 0.1F};
const Rgb kHeadLamp = {0.8F, 0.8F, 0.76F};
const Rgb kGlass = {0.07F, 0.08F, 0.09F};
const Rgb kPlate = {0.85F, 0.85F, 0.82F};
const Rgb kShadow = {0.07F, 0.07F, 0.075F};  // what the sky cannot reach

void add_parts(const RoadFrame& at,
               std::span<const Part> parts,
               const Style& common,
               Scene& scene) {
  Style style = common;
  for (const Part& part : parts) {
    const Vec3 corner = at.position + part.corner.x() * at.forward + part.corner.y() * at.right +
                        part.corner.z() * at.up;
    style.albedo = part.albedo;
    style.material = part.material;
    scene.add_box(corner,
                  {part.size.x() * at.forward, part.size.y() * at.right,
                   part.size.z() * at.up - part.lean_m * at.forward},
                  style);
  }
}

Part shadow(double length_m, double width_m) {
  return {kShadow, {-0.1, -0.1 - 0.5 * width_m, 0.0}, {length_m + 0.2, width_m + 0.2, 0.015}};
}

Rgb any_paint(Draw& draw) {
  const float light = draw.in_float(0.25, 0.8);
  const auto tint = [&] { return draw.in_float(0.4, 1.1); };
  return Rgb{tint(), tint(), tint()} * light;
}

constexpr double kFoundation_m = 1.2;  // walls go into the ground, which may slope

/// A post with three lamps, before the crossing on the right.
void add_lights(const RoadFrame& middle, Scene& scene) {
  constexpr double kBefore_m = kCrossingHalf_m + 1.0;
  const Vec3 foot = middle.position - kBefore_m * middle.forward + 4.7 * middle.right;
  const Vec3 up = -Vec3::UnitY();
  scene.add_prism(foot, 0.06, 3.3, {.albedo = {0.2F, 0.22F, 0.2F}});
  const Vec3 corner = foot + 2.4 * up - 0.16 * middle.right - 0.1 * middle.forward;
  scene.add_box(corner, {0.2 * middle.forward, 0.32 * middle.right, 0.95 * up},
                {.albedo = {0.05F, 0.06F, 0.05F}});
  const std::array<Rgb, 3> lamps = {{{0.1F, 0.3F, 0.15F}, {0.5F, 0.4F, 0.1F}, {0.9F, 0.1F, 0.08F}}};
  for (std::size_t i = 0; i < lamps.size(); ++i) {
    const double low = 0.06 + 0.3 * static_cast<double>(i);
    scene.add_box(corner + low * up + 0.06 * middle.right - 0.02 * middle.forward,
                  {0.02 * middle.forward, 0.2 * middle.right, 0.2 * up}, {.albedo = lamps[i]});
  }
}

}  // namespace

void add_car(const RoadFrame& at, Draw draw, bool moves, Scene& scene, bool is_parked) {
  const Material body = is_parked ? nullptr : materials::bodywork;
  const float gray = draw.in_float(0.05, 0.75);
  const float tint = draw.in_float(-0.12, 0.12);
  const Rgb paint = {gray + std::max(tint, 0.0F), gray, gray + std::max(-tint, 0.0F)};
  const std::uint32_t seed = draw.bits();
  const double width = draw.in(1.65, 1.8);
  const double length = draw.in(3.9, 4.7);
  const auto across = [&](double right_of_left_side) { return right_of_left_side - 0.5 * width; };
  std::vector<Part> parts = {
      {paint, {0.0, across(0.0), 0.3}, {length, width, 0.52}, body},
      {kGlass, {0.12 * length, across(0.09), 0.82}, {0.55 * length, width - 0.18, 0.5}},
      {paint, {0.2 * length, across(0.12), 1.32}, {0.38 * length, width - 0.24, 0.1}, body},
      {kTyre, {0.12 * length, across(-0.02), 0.0}, {0.6, width + 0.04, 0.58}},
      {kTyre, {0.72 * length, across(-0.02), 0.0}, {0.6, width + 0.04, 0.58}},
      {kTailLamp, {-0.02, across(0.05), 0.62}, {0.02, 0.3, 0.14}},
      {kTailLamp, {-0.02, across(width - 0.35), 0.62}, {0.02, 0.3, 0.14}},
      {kPlate, {-0.02, across(0.5 * width - 0.26), 0.5}, {0.02, 0.52, 0.11}},
      shadow(length, width)};
  if (!is_parked) {
    const double side = 0.5 * width;
    parts.insert(parts.end(), {{kHeadLamp, {length, 0.05 - side, 0.58}, {0.02, 0.36, 0.16}},
                               {kHeadLamp, {length, side - 0.41, 0.58}, {0.02, 0.36, 0.16}},
                               {kTyre, {length, 0.45 - side, 0.45}, {0.015, width - 0.9, 0.2}}});
  }
  add_parts(at, parts, {.seed = seed, .moves = moves}, scene);
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
  add_parts(at, parts, common, scene);
}

void add_person(const RoadFrame& at, Draw draw, double stride_rad, bool moves, Scene& scene) {
  const double tall = draw.in(0.92, 1.08);
  const Rgb coat = any_paint(draw);
  const Rgb trousers = any_paint(draw) * 0.5F;
  const Style common{.seed = draw.bits(), .moves = moves};
  const Rgb skin = {0.5F, 0.36F, 0.28F};
  // Legs and arms lean forward and back by turns.
  const double swing_m = 0.3 * std::sin(stride_rad);
  const auto limb = [](double side_m, double top_m, double length_m, double reach_m,
                       const Rgb& colour, double width_m) {
    const Vec3 foot(reach_m - 0.5 * width_m, side_m - 0.5 * width_m, top_m - length_m);
    return Part{colour, foot, {width_m, width_m, length_m}, materials::cloth, reach_m};
  };
  const std::array<Part, 7> body = {{
      {coat, {-0.12, -0.22, 0.82 * tall}, {0.24, 0.44, 0.62 * tall}, materials::cloth},
      {skin, {-0.1, -0.09, 1.48 * tall}, {0.2, 0.18, 0.25}, materials::cloth},
      shadow(0.3, 0.35),
      limb(-0.11, 0.85 * tall, 0.84 * tall, swing_m, trousers, 0.16),
      limb(0.11, 0.85 * tall, 0.84 * tall, -swing_m, trousers, 0.16),
      limb(-0.28, 1.4 * tall, 0.6 * tall, -swing_m, coat, 0.1),
      limb(0.28, 1.4 * tall, 0.6 * tall, swing_m, coat, 0.1),
  }};
  add_parts(at, body, common, scene);
}

void House::add(double eaves_m, double rise_m, std::uint32_t roof_seed) {
  const auto& [fl, fr, br, bl] = plan;
  const Vec3 down = -kFoundation_m * up;
  const Vec3 top = eaves_m * up;
  for (const auto& [left, right] : {std::pair(fl, fr), std::pair(bl, fl), std::pair(fr, br)}) {
    const double length_m = (right - left).norm();
    style.size = {static_cast<float>(length_m), static_cast<float>(eaves_m)};
    scene.add_face(
        {left + down, right + down, right + top, left + top},
        {Vec2(0.0, -kFoundation_m), Vec2(length_m, -kFoundation_m), Vec2(length_m, eaves_m)},
        style);
  }
  const Vec3 left_ridge = 0.5 * (fl + bl) + (eaves_m + rise_m) * up;
  const Vec3 right_ridge = 0.5 * (fr + br) + (eaves_m + rise_m) * up;
  const Vec3 over_left = 0.12 * (fl - bl).normalized() - 0.1 * up;
  const Vec3 over_right = 0.12 * (fr - br).normalized() - 0.1 * up;
  const Vec3 front_left = fl + eaves_m * up + over_left;
  const Vec3 front_right = fr + eaves_m * up + over_right;
  const double length_m = (front_right - front_left).norm();
  const double slope_m = (left_ridge - front_left).norm();
  scene.add_patch(
      {front_left, front_right, right_ridge, left_ridge},
      {Vec2(0, 0), Vec2(length_m, 0), Vec2(length_m, slope_m), Vec2(0, slope_m)},
      {.material = materials::roof,
       .seed = roof_seed,
       .albedo = (roof_seed & 1U) != 0U ? Rgb{0.40F, 0.20F, 0.14F} : Rgb{0.24F, 0.23F, 0.23F}});
  style.material = materials::plain_wall;
  for (const auto& [front, back, ridge] :
       {std::tuple(fl, bl, left_ridge), std::tuple(fr, br, right_ridge)}) {
    const Vec3 a = front + eaves_m * up;
    const Vec3 b = back + eaves_m * up;
    const double width_m = (b - a).norm();
    scene.add_face(
        {a, b, ridge, ridge},
        {Vec2(0, eaves_m), Vec2(width_m, eaves_m), Vec2(0.5 * width_m, eaves_m + rise_m)}, style);
  }
}

void add_side_streets(const RoadFrame& middle, std::uint64_t seed, Scene& scene) {
  constexpr double kWide_m = 2.0 * kCrossingHalf_m;
  const auto at = [&](double along, double lateral, double height) -> Vec3 {
    return middle.position + along * middle.forward + lateral * middle.right + height * middle.up;
  };
  for (const double side : {-1.0, 1.0}) {
    Draw draw(seed, 'q', side > 0.0);
    const double near = side * kStreetHalfWidth_m;
    const double far = side * kCrossingEnd_m;
    const double length = kCrossingEnd_m - kStreetHalfWidth_m;
    // The pattern's dashes and tracks run along this road, too.
    scene.add_face({at(-kCrossingHalf_m, near, 0.0), at(-kCrossingHalf_m, far, 0.0),
                    at(kCrossingHalf_m, far, 0.0), at(kCrossingHalf_m, near, 0.0)},
                   {Vec2(0.0, -kCrossingHalf_m - 1.7), Vec2(length, -kCrossingHalf_m - 1.7),
                    Vec2(length, kCrossingHalf_m - 1.7)},
                   {.material = materials::asphalt, .seed = draw.bits(), .albedo = kAsphalt});
    for (const double edge : {-1.0, 1.0}) {
      const double along = edge * kCrossingHalf_m;
      const double height = draw.in(2.0, 3.0);
      scene.add_face(
          {at(along, near, 0.0), at(along, far, 0.0), at(along, far, height),
           at(along, near, height)},
          {Vec2(0.0, 0.0), Vec2(length, 0.0), Vec2(length, height)},
          {.material = materials::hedge, .seed = draw.bits(), .albedo = {0.15F, 0.22F, 0.09F}});
    }
    const double wall = draw.in(6.0, 9.0);
    House house{
        {at(-1.2 * kWide_m, far, 0.0), at(1.2 * kWide_m, far, 0.0),
         at(1.2 * kWide_m, far + side * 8.0, 0.0), at(-1.2 * kWide_m, far + side * 8.0, 0.0)},
        -Vec3::UnitY(),
        {.material = materials::facade, .seed = draw.bits()},
        scene};
    house.style.albedo = Rgb{0.72F, 0.64F, 0.48F} * draw.in_float(0.7, 1.2);
    house.add(wall, 2.4, draw.bits());
  }
  add_lights(middle, scene);
}

}  // namespace stemvo::synth
