// SPDX-License-Identifier: MIT
#include <algorithm>

#include <Eigen/Geometry>

#include "dataset/synth/hash.hpp"
#include "dataset/synth/scene.hpp"

namespace stemvo::synth {
namespace {

constexpr double kRoomy = 0.75;  // things stand only where a tight turn leaves the street its width

void add_car(const RoadFrame& place, double lateral_m, Draw draw, Scene& scene) {
  Style paint;
  const float gray = static_cast<float>(draw.in(0.05, 0.75));
  const float tint = static_cast<float>(draw.in(-0.12, 0.12));
  paint.albedo = {gray + std::max(tint, 0.0F), gray, gray + std::max(-tint, 0.0F)};
  paint.seed = draw.bits();
  Style glass = paint;
  glass.albedo = {0.07F, 0.08F, 0.09F};
  Style tyre = paint;
  tyre.albedo = {0.03F, 0.03F, 0.03F};
  const double width_m = draw.in(1.65, 1.8);
  const double length_m = draw.in(3.9, 4.7);
  const auto box = [&](double x, double y, double z, double dx, double dy, double dz,
                       const Style& style) {  // along, to the right, up from the car's corner
    const Eigen::Vector3d corner = place.point(lateral_m, 0.0) + x * place.forward +
                                   (y - 0.5 * width_m) * place.right + z * place.up;
    scene.add_box(corner, {dx * place.forward, dy * place.right, dz * place.up}, style);
  };
  box(0.0, 0.0, 0.3, length_m, width_m, 0.52, paint);
  box(0.12 * length_m, 0.09, 0.82, 0.55 * length_m, width_m - 0.18, 0.5, glass);
  box(0.2 * length_m, 0.12, 1.32, 0.38 * length_m, width_m - 0.24, 0.1, paint);
  for (const double x : {0.12 * length_m, 0.72 * length_m}) {
    box(x, -0.02, 0.0, 0.6, width_m + 0.04, 0.58, tyre);
  }
  Style lamps = paint;
  lamps.albedo = {0.6F, 0.12F, 0.1F};
  box(-0.02, 0.05, 0.62, 0.02, 0.3, 0.14, lamps);
  box(-0.02, width_m - 0.35, 0.62, 0.02, 0.3, 0.14, lamps);
  Style plate = paint;
  plate.albedo = {0.85F, 0.85F, 0.82F};
  box(-0.02, 0.5 * width_m - 0.26, 0.5, 0.02, 0.52, 0.11, plate);
  Style shadow = paint;  // a thin dark mat: what the sky cannot reach
  shadow.albedo = {0.07F, 0.07F, 0.075F};
  box(-0.1, -0.1, 0.0, length_m + 0.2, width_m + 0.2, 0.015, shadow);
}

}  // namespace

void add_poles(const StreetContext& street, Scene& scene) {
  for_each_slot(street, 14.0, [&](int slot, double arc_m) {
    Draw draw(street.seed, 'P', slot);
    const bool is_lamp = draw.chance(0.5);
    const double lateral_m = draw.chance(0.5) ? 4.75 : -5.6;
    const RoadFrame place = street.road.at(arc_m + draw.in(1.0, 13.0));
    if (place.squeeze(lateral_m) < kRoomy || draw.chance(0.25)) {
      return;
    }
    Style style;
    style.albedo = is_lamp ? std::array{0.28F, 0.31F, 0.30F} : std::array{0.5F, 0.5F, 0.5F};
    const Eigen::Vector3d up = -Eigen::Vector3d::UnitY();
    const Eigen::Vector3d foot = place.point(lateral_m, 0.0);
    const double height_m = is_lamp ? 6.5 : 2.6;
    scene.add_prism(foot, up, is_lamp ? 0.075 : 0.035, height_m, style);
    if (is_lamp) {
      const Eigen::Vector3d arm = (lateral_m > 0.0 ? -1.2 : 1.2) * place.right;
      scene.add_box(foot + height_m * up, {arm, 0.12 * place.forward, 0.1 * up}, style);
    } else {
      const double kind = draw.next();
      style.albedo = kind < 0.4   ? std::array{0.75F, 0.75F, 0.72F}
                     : kind < 0.7 ? std::array{0.15F, 0.25F, 0.6F}
                                  : std::array{0.7F, 0.62F, 0.2F};
      scene.add_box(foot + 1.95 * up - 0.3 * place.right - 0.06 * place.forward,
                    {0.6 * place.right, 0.03 * place.forward, 0.6 * up}, style);
    }
  });
}

void add_parked_cars(const StreetContext& street, Scene& scene) {
  for_each_slot(street, 6.5, [&](int slot, double arc_m) {
    Draw draw(street.seed, 'C', slot);
    const RoadFrame place = street.road.at(arc_m + draw.in(0.5, 1.4));
    constexpr double kLateral_m = 3.35;
    if (place.squeeze_right > 0.95 && draw.chance(0.3)) {
      add_car(place, kLateral_m, draw, scene);
    }
  });
}

}  // namespace stemvo::synth
