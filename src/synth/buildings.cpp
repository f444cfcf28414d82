// SPDX-License-Identifier: MIT
#include "synth/buildings.hpp"

#include "synth/materials.hpp"

namespace stemvo::synth {
namespace {

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

void House::add_walls(double height_m) {
  const auto& [fl, fr, br, bl] = plan;
  const Vec3 down = -kFoundation_m * up;
  const Vec3 top = height_m * up;
  for (const auto& [left, right] : {std::pair(fl, fr), std::pair(bl, fl), std::pair(fr, br)}) {
    const double length_m = (right - left).norm();
    style.size = {static_cast<float>(length_m), static_cast<float>(height_m)};
    scene.add_face(
        {left + down, right + down, right + top, left + top},
        {Vec2(0.0, -kFoundation_m), Vec2(length_m, -kFoundation_m), Vec2(length_m, height_m)},
        style);
  }
}

void House::add_roof(double eaves_m, double rise_m, std::uint32_t seed) {
  const auto& [fl, fr, br, bl] = plan;
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
       .seed = seed,
       .albedo = (seed & 1U) != 0U ? Rgb{0.40F, 0.20F, 0.14F} : Rgb{0.24F, 0.23F, 0.23F}});
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
    house.style.albedo = scaled({0.72F, 0.64F, 0.48F}, draw.in_float(0.7, 1.2));
    house.add_walls(wall);
    house.add_roof(wall, 2.4, draw.bits());
  }
  add_lights(middle, scene);
}

}  // namespace stemvo::synth
