// SPDX-License-Identifier: MIT
#include <algorithm>

#include "dataset/synth/hash.hpp"
#include "dataset/synth/scene.hpp"

namespace stemvo::synth {
namespace {

constexpr double kLot_m = 16.0;
constexpr double kFoundation_m = 1.2;  // walls go into the ground, which may slope

constexpr std::array<std::array<float, 3>, 8> kPlaster = {{{0.78F, 0.76F, 0.70F},
                                                           {0.72F, 0.64F, 0.48F},
                                                           {0.62F, 0.60F, 0.57F},
                                                           {0.66F, 0.52F, 0.42F},
                                                           {0.50F, 0.33F, 0.26F},
                                                           {0.80F, 0.74F, 0.58F},
                                                           {0.56F, 0.60F, 0.63F},
                                                           {0.44F, 0.42F, 0.40F}}};

/// Corners of the ground plan: front left, front right, back right, back left, as seen on foot.
struct Plan {
  std::array<Eigen::Vector3d, 4> corners;
  Eigen::Vector3d up;
};

Plan lay_plan(const RoadCurve& road, double side, double begin_m, double end_m, double setback_m) {
  const RoadFrame a = road.at(begin_m);
  const RoadFrame b = road.at(end_m);
  const double front_m = side * setback_m;
  const double back_m = side * (kStreetHalfWidth_m + 1.0);
  Plan plan;
  plan.corners = {a.point(front_m, 0.0), b.point(front_m, 0.0), b.point(back_m, 0.0),
                  a.point(back_m, 0.0)};
  plan.up = road.at(0.5 * (begin_m + end_m)).up;
  // Level the plan: a house does not lean with the street.
  const double level = plan.up.dot(plan.corners[0] + plan.corners[1]) / 2.0;
  for (Eigen::Vector3d& corner : plan.corners) {
    corner += (level - plan.up.dot(corner)) * plan.up;
  }
  return plan;
}

void add_wall(const Eigen::Vector3d& left,
              const Eigen::Vector3d& right,
              const Eigen::Vector3d& up,
              double height_m,
              Style style,
              Scene& scene) {
  const double length_m = (right - left).norm();
  style.size = {static_cast<float>(length_m), static_cast<float>(height_m)};
  const Eigen::Vector3d down = -kFoundation_m * up;
  scene.add_quad({left + down, right + down, right + height_m * up, left + height_m * up},
                 {Eigen::Vector2d(0.0, -kFoundation_m), Eigen::Vector2d(length_m, -kFoundation_m),
                  Eigen::Vector2d(length_m, height_m)},
                 style);
}

/// A gable roof with its ridge along the street, over the eaves by `overhang`.
void add_roof(const Plan& plan,
              double eaves_m,
              double rise_m,
              const Style& wall,
              std::uint32_t seed,
              Scene& scene) {
  const auto& [fl, fr, br, bl] = plan.corners;
  const Eigen::Vector3d left_ridge = 0.5 * (fl + bl) + (eaves_m + rise_m) * plan.up;
  const Eigen::Vector3d right_ridge = 0.5 * (fr + br) + (eaves_m + rise_m) * plan.up;
  const Eigen::Vector3d over_left = 0.12 * (fl - bl).normalized() - 0.1 * plan.up;
  const Eigen::Vector3d over_right = 0.12 * (fr - br).normalized() - 0.1 * plan.up;
  const Eigen::Vector3d front_left = fl + eaves_m * plan.up + over_left;
  const Eigen::Vector3d front_right = fr + eaves_m * plan.up + over_right;
  Style style;
  style.material = Material::kRoof;
  style.seed = seed;
  style.albedo =
      (seed & 1U) != 0U ? std::array{0.40F, 0.20F, 0.14F} : std::array{0.24F, 0.23F, 0.23F};
  const double length_m = (front_right - front_left).norm();
  const double slope_m = (left_ridge - front_left).norm();
  scene.add_patch({front_left, front_right, right_ridge, left_ridge},
                  {Eigen::Vector2d(0, 0), Eigen::Vector2d(length_m, 0),
                   Eigen::Vector2d(length_m, slope_m), Eigen::Vector2d(0, slope_m)},
                  style);
  Style gable = wall;
  gable.material = Material::kPlainWall;
  for (const auto& [front, back, ridge] :
       {std::tuple(fl, bl, left_ridge), std::tuple(fr, br, right_ridge)}) {
    const Eigen::Vector3d a = front + eaves_m * plan.up;
    const Eigen::Vector3d b = back + eaves_m * plan.up;
    scene.add_quad({a, b, ridge, ridge},
                   {Eigen::Vector2d(0, eaves_m), Eigen::Vector2d((b - a).norm(), eaves_m),
                    Eigen::Vector2d(0.5 * (b - a).norm(), eaves_m + rise_m)},
                   gable);
  }
}

void add_building(const StreetContext& street, double side, int slot, double arc_m, Scene& scene) {
  Draw draw(street.seed, 'H', side > 0.0, slot);
  if (!draw.chance(0.72)) {
    return;  // a garden
  }
  const double begin_m = arc_m + draw.in(0.2, 2.5);
  const double end_m = arc_m + kLot_m - draw.in(0.2, 3.5);
  const double setback_m = draw.in(7.6, 10.4);
  const int floors = 1 + static_cast<int>(draw.in(1.0, 3.6));
  const double eaves_m = 0.6 + 2.9 * floors;
  Style style;
  style.seed = draw.bits();
  style.albedo = kPlaster[draw.bits() % kPlaster.size()];
  const float tone = static_cast<float>(draw.in(0.85, 1.2));
  for (float& value : style.albedo) {
    value *= tone;
  }
  const Plan plan = lay_plan(street.road, side, begin_m, end_m, setback_m);
  const auto& [fl, fr, br, bl] = plan.corners;
  style.material = Material::kFacade;
  add_wall(fl, fr, plan.up, eaves_m, style, scene);
  add_wall(bl, fl, plan.up, eaves_m, style, scene);
  add_wall(fr, br, plan.up, eaves_m, style, scene);
  add_roof(plan, eaves_m, draw.in(1.6, 3.2), style, draw.bits(), scene);
}

}  // namespace

void add_buildings(const StreetContext& street, Scene& scene) {
  for (const double side : {-1.0, 1.0}) {
    for_each_slot(street, kLot_m,
                  [&](int slot, double arc_m) { add_building(street, side, slot, arc_m, scene); });
  }
}

}  // namespace stemvo::synth
