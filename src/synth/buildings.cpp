// SPDX-License-Identifier: MIT
#include "synth/materials.hpp"
#include "synth/street.hpp"

namespace stemvo::synth {
namespace {

constexpr double kLot_m = 16.0;
constexpr double kFoundation_m = 1.2;  // walls go into the ground, which may slope

constexpr std::array<Rgb, 8> kPlaster = {{{0.78F, 0.76F, 0.70F},
                                          {0.72F, 0.64F, 0.48F},
                                          {0.62F, 0.60F, 0.57F},
                                          {0.66F, 0.52F, 0.42F},
                                          {0.50F, 0.33F, 0.26F},
                                          {0.80F, 0.74F, 0.58F},
                                          {0.56F, 0.60F, 0.63F},
                                          {0.44F, 0.42F, 0.40F}}};

/// Corners of the ground plan: front left, front right, back right, back left, as seen on foot.
struct Plan {
  std::array<Vec3, 4> corners;
  Vec3 up;
};

Plan lay_plan(const RoadCurve& road, double side, double begin_m, double end_m, double setback_m) {
  const RoadFrame a = road.at(begin_m);
  const RoadFrame b = road.at(end_m);
  const double front_m = side * setback_m;
  const double back_m = side * (kStreetHalfWidth_m + 1.0);
  Plan plan{
      {a.point(front_m, 0.0), b.point(front_m, 0.0), b.point(back_m, 0.0), a.point(back_m, 0.0)},
      road.at(0.5 * (begin_m + end_m)).up};
  // Level the plan: a house does not lean with the street.
  const double level = plan.up.dot(plan.corners[0] + plan.corners[1]) / 2.0;
  for (Vec3& corner : plan.corners) {
    corner += (level - plan.up.dot(corner)) * plan.up;
  }
  return plan;
}

void add_walls(const Plan& plan, double height_m, Style style, Scene& scene) {
  const auto& [fl, fr, br, bl] = plan.corners;
  const Vec3 down = -kFoundation_m * plan.up;
  const Vec3 top = height_m * plan.up;
  for (const auto& [left, right] : {std::pair(fl, fr), std::pair(bl, fl), std::pair(fr, br)}) {
    const double length_m = (right - left).norm();
    style.size = {static_cast<float>(length_m), static_cast<float>(height_m)};
    scene.add_face(
        {left + down, right + down, right + top, left + top},
        {Vec2(0.0, -kFoundation_m), Vec2(length_m, -kFoundation_m), Vec2(length_m, height_m)},
        style);
  }
}

/// A gable roof with its ridge along the street, over the eaves by 12 cm.
void add_roof(const Plan& plan,
              double eaves_m,
              double rise_m,
              std::uint32_t seed,
              Style gable,
              Scene& scene) {
  const auto& [fl, fr, br, bl] = plan.corners;
  const Vec3 left_ridge = 0.5 * (fl + bl) + (eaves_m + rise_m) * plan.up;
  const Vec3 right_ridge = 0.5 * (fr + br) + (eaves_m + rise_m) * plan.up;
  const Vec3 over_left = 0.12 * (fl - bl).normalized() - 0.1 * plan.up;
  const Vec3 over_right = 0.12 * (fr - br).normalized() - 0.1 * plan.up;
  const Vec3 front_left = fl + eaves_m * plan.up + over_left;
  const Vec3 front_right = fr + eaves_m * plan.up + over_right;
  const double length_m = (front_right - front_left).norm();
  const double slope_m = (left_ridge - front_left).norm();
  scene.add_patch(
      {front_left, front_right, right_ridge, left_ridge},
      {Vec2(0, 0), Vec2(length_m, 0), Vec2(length_m, slope_m), Vec2(0, slope_m)},
      {.material = &materials::kRoof,
       .seed = seed,
       .albedo = (seed & 1U) != 0U ? Rgb{0.40F, 0.20F, 0.14F} : Rgb{0.24F, 0.23F, 0.23F}});
  gable.material = &materials::kPlainWall;
  for (const auto& [front, back, ridge] :
       {std::tuple(fl, bl, left_ridge), std::tuple(fr, br, right_ridge)}) {
    const Vec3 a = front + eaves_m * plan.up;
    const Vec3 b = back + eaves_m * plan.up;
    const double width_m = (b - a).norm();
    scene.add_face(
        {a, b, ridge, ridge},
        {Vec2(0, eaves_m), Vec2(width_m, eaves_m), Vec2(0.5 * width_m, eaves_m + rise_m)}, gable);
  }
}

void add_building(const Street& street, double side, double arc_m, Draw draw) {
  const double begin_m = arc_m + draw.in(0.2, 2.5);
  const double end_m = arc_m + kLot_m - draw.in(0.2, 3.5);
  const Plan plan = lay_plan(street.road, side, begin_m, end_m, draw.in(7.6, 10.4));
  const int floors = 1 + static_cast<int>(draw.in(1.0, 3.6));
  const double eaves_m = 0.6 + 2.9 * floors;
  Style style{.material = &materials::kFacade, .seed = draw.bits()};
  style.albedo = kPlaster[draw.bits() % kPlaster.size()];
  style.albedo = scaled(style.albedo, draw.in_float(0.85, 1.2));
  add_walls(plan, eaves_m, style, street.scene);
  const std::uint32_t roof_seed = draw.bits();
  add_roof(plan, eaves_m, draw.in(1.6, 3.2), roof_seed, style, street.scene);
}

}  // namespace

void add_buildings(const Street& street) {
  for (const double side : {-1.0, 1.0}) {
    street.for_each_lot('H', side, kLot_m, [&](Draw draw, double arc_m) {
      if (draw.chance(0.72)) {  // else a garden
        add_building(street, side, arc_m, draw);
      }
    });
  }
}

}  // namespace stemvo::synth
