// SPDX-License-Identifier: MIT
#include "synth/crossing.hpp"

#include "synth/house.hpp"
#include "synth/materials.hpp"

namespace stemvo::synth {
namespace {

constexpr Rgb kAsphalt = {0.345F, 0.345F, 0.35F};

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
