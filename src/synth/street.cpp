// SPDX-License-Identifier: MIT
#include "synth/street.hpp"

#include <algorithm>

#include "synth/materials.hpp"

namespace stemvo::synth {
namespace {

/// Last knot from `start` in direction `step` before the road comes back near the way from `from`,
/// a knot on the other side of `start`.
int last_clear_knot(const RoadCurve& road, int from, int start, int step, double reach_m) {
  constexpr double kClear_m = 2.0 * kStreetHalfWidth_m;
  constexpr int kNeighbours = 45;  // knots: nearer ones are the same street
  const int end = start + step * static_cast<int>(reach_m / kKnotSpacing_m);
  for (int i = start; i != end; i += step) {
    const int next = i + step;
    if (next < 0 || next >= road.num_knots()) {
      return i;
    }
    for (int j = from; (next - j) * step >= kNeighbours; j += step) {
      if ((road.knot(next).position - road.knot(j).position).norm() < kClear_m) {
        return i;
      }
    }
  }
  return end;
}

/// A corner of a face between two knots of the road.
struct Corner {
  int knot;  ///< 0 or 1
  double lateral_m;
  double height_m;
  double v;
};

void add_segment(const Street& street,
                 int knot,
                 const std::array<Corner, 4>& corners,
                 const Style& style) {
  std::array<Vec3, 4> points;
  std::array<Vec2, 4> texture;
  for (std::size_t k = 0; k < 4; ++k) {
    const Corner& corner = corners[k];
    points[k] = street.road.knot(knot + corner.knot).point(corner.lateral_m, corner.height_m);
    const double u = knot * kKnotSpacing_m - street.texture_origin_m;
    texture[k] = {u + corner.knot * kKnotSpacing_m, corner.v};
  }
  street.scene.add_patch(points, texture, style);
}

/// Strips between two lines along the road; lateral distances to the right of the camera's path,
/// which runs in the right lane.
void add_ground(const Street& street) {
  struct Strip {
    const Material& material;
    Rgb albedo;
    double left_m;
    double left_height_m;
    double right_m;
    double right_height_m;
  };
  constexpr Rgb kStone = {0.46F, 0.445F, 0.42F};
  constexpr Rgb kPaving = {0.43F, 0.41F, 0.39F};
  constexpr Rgb kGreen = {0.24F, 0.32F, 0.13F};
  constexpr double kKerb_m = 0.12;
  static const std::array<Strip, 9> kStrips = {{
      {materials::kGrass, kGreen, -kStreetHalfWidth_m, 0.25, -7.2, kKerb_m},
      {materials::kSidewalk, kPaving, -7.2, kKerb_m, -5.35, kKerb_m},
      {materials::kKerb, kStone, -5.35, kKerb_m, -5.2, kKerb_m},
      {materials::kKerb, kStone, -5.2, kKerb_m, -5.2, 0.0},
      {materials::kAsphalt, {0.345F, 0.345F, 0.35F}, -5.2, 0.0, 2.2, 0.0},
      {materials::kParking, {0.38F, 0.365F, 0.355F}, 2.2, 0.0, 4.4, 0.0},
      {materials::kKerb, kStone, 4.4, 0.0, 4.4, kKerb_m},
      {materials::kSidewalk, kPaving, 4.4, kKerb_m, 6.6, kKerb_m},
      {materials::kGrass, kGreen, 6.6, kKerb_m, kStreetHalfWidth_m, 0.25},
  }};
  for (const auto& [material, albedo, left_m, left_height_m, right_m, right_height_m] : kStrips) {
    const Style style{.material = &material,
                      .seed = static_cast<std::uint32_t>(hash_of(street.seed, 'G')),
                      .albedo = albedo};
    const bool is_upright = left_m == right_m;
    const double v_left = is_upright ? left_height_m : left_m;
    const double v_right = is_upright ? right_height_m : right_m;
    for (int i = street.window.begin; i + 1 < street.window.end; ++i) {
      add_segment(street, i,
                  {{{0, left_m, left_height_m, v_left},
                    {0, right_m, right_height_m, v_right},
                    {1, right_m, right_height_m, v_right},
                    {1, left_m, left_height_m, v_left}}},
                  style);
    }
  }
}

/// Hedge, garden wall or fence at the outer edges, a new kind every 16 m or so.
void add_borders(const Street& street) {
  struct Kind {
    const Material& material;
    Rgb albedo;
    double height;
  };
  static const Kind kHedge = {materials::kHedge, {0.15F, 0.22F, 0.09F}, 1.0};
  static const Kind kWall = {materials::kPlainWall, {0.55F, 0.52F, 0.48F}, 0.8};
  static const Kind kFence = {materials::kFence, {0.33F, 0.25F, 0.17F}, 0.75};
  for (const double side : {-1.0, 1.0}) {
    const double lateral_m = side * kStreetHalfWidth_m;
    for (int i = street.window.begin; i + 1 < street.window.end; ++i) {
      Draw draw(street.seed, 'B', side > 0.0, i / 16);
      const std::uint32_t seed = draw.bits();
      const double share = draw.next();
      const Kind& kind = share < 0.6 ? kHedge : share < 0.8 ? kWall : kFence;
      const double height_m = draw.in(1.9, 3.2) * kind.height;
      add_segment(street, i,
                  {{{0, lateral_m, 0.0, 0.0},
                    {1, lateral_m, 0.0, 0.0},
                    {1, lateral_m, height_m, height_m},
                    {0, lateral_m, height_m, height_m}}},
                  {.material = &kind.material, .seed = seed, .albedo = kind.albedo});
    }
  }
}

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

void add_buildings(const Street& street) {
  for (const double side : {-1.0, 1.0}) {
    street.for_each_lot('H', side, kLot_m, [&](Draw draw, double arc_m) {
      if (draw.chance(0.72)) {  // else a garden
        add_building(street, side, arc_m, draw);
      }
    });
  }
}

void add_poles(const Street& street) {
  street.for_each_slot(14.0, [&](int slot, double arc_m) {
    Draw draw(street.seed, 'P', slot);
    const bool is_lamp = draw.chance(0.5);
    const double lateral_m = draw.chance(0.5) ? 4.75 : -5.6;
    const RoadFrame place = street.road.at(arc_m + draw.in(1.0, 13.0));
    if (place.squeeze(lateral_m) < kRoomy || draw.chance(0.25)) {
      return;
    }
    const Vec3 up = -Vec3::UnitY();
    const Vec3 foot = place.point(lateral_m, 0.0);
    if (is_lamp) {
      constexpr double kHeight_m = 6.5;
      const Style style{.albedo = {0.28F, 0.31F, 0.30F}};
      const Vec3 arm = (lateral_m > 0.0 ? -1.2 : 1.2) * place.right;
      street.scene.add_prism(foot, 0.075, kHeight_m, style);
      street.scene.add_box(foot + kHeight_m * up, {arm, 0.12 * place.forward, 0.1 * up}, style);
    } else {
      const double kind = draw.next();
      const Style sign{.albedo = kind < 0.4   ? Rgb{0.75F, 0.75F, 0.72F}
                                 : kind < 0.7 ? Rgb{0.15F, 0.25F, 0.6F}
                                              : Rgb{0.7F, 0.62F, 0.2F}};
      street.scene.add_prism(foot, 0.035, 2.6, {.albedo = {0.5F, 0.5F, 0.5F}});
      street.scene.add_box(foot + 1.95 * up - 0.3 * place.right - 0.06 * place.forward,
                           {0.6 * place.right, 0.03 * place.forward, 0.6 * up}, sign);
    }
  });
}

void add_car(const RoadFrame& place, Draw draw, Scene& scene) {
  constexpr double kLateral_m = 3.35;
  const float gray = draw.in_float(0.05, 0.75);
  const float tint = draw.in_float(-0.12, 0.12);
  const Rgb paint = {gray + std::max(tint, 0.0F), gray, gray + std::max(-tint, 0.0F)};
  const std::uint32_t seed = draw.bits();
  const double width = draw.in(1.65, 1.8);
  const double length = draw.in(3.9, 4.7);
  struct Part {
    Rgb albedo;
    Vec3 corner;  ///< along, to the right, up from the car's corner; metres
    Vec3 size;
  };
  constexpr Rgb kTyre = {0.03F, 0.03F, 0.03F};
  constexpr Rgb kLamp = {0.6F, 0.12F, 0.1F};
  const std::array<Part, 9> parts = {{
      {paint, {0.0, 0.0, 0.3}, {length, width, 0.52}},
      {{0.07F, 0.08F, 0.09F}, {0.12 * length, 0.09, 0.82}, {0.55 * length, width - 0.18, 0.5}},
      {paint, {0.2 * length, 0.12, 1.32}, {0.38 * length, width - 0.24, 0.1}},
      {kTyre, {0.12 * length, -0.02, 0.0}, {0.6, width + 0.04, 0.58}},
      {kTyre, {0.72 * length, -0.02, 0.0}, {0.6, width + 0.04, 0.58}},
      {kLamp, {-0.02, 0.05, 0.62}, {0.02, 0.3, 0.14}},
      {kLamp, {-0.02, width - 0.35, 0.62}, {0.02, 0.3, 0.14}},
      {{0.85F, 0.85F, 0.82F}, {-0.02, 0.5 * width - 0.26, 0.5}, {0.02, 0.52, 0.11}},
      // A thin dark mat below the car: what the sky cannot reach.
      {{0.07F, 0.07F, 0.075F}, {-0.1, -0.1, 0.0}, {length + 0.2, width + 0.2, 0.015}},
  }};
  for (const auto& [albedo, corner, size] : parts) {
    const Vec3 at = place.point(kLateral_m, 0.0) + corner.x() * place.forward +
                    (corner.y() - 0.5 * width) * place.right + corner.z() * place.up;
    scene.add_box(at, {size.x() * place.forward, size.y() * place.right, size.z() * place.up},
                  {.seed = seed, .albedo = albedo});
  }
}

void add_parked_cars(const Street& street) {
  street.for_each_slot(6.5, [&](int slot, double arc_m) {
    Draw draw(street.seed, 'C', slot);
    const RoadFrame place = street.road.at(arc_m + draw.in(0.5, 1.4));
    if (place.squeeze_right > 0.95 && draw.chance(0.3)) {
      add_car(place, draw, street.scene);
    }
  });
}

}  // namespace

RoadWindow visible_window(const RoadCurve& road, double arc_m) {
  constexpr double kSeenBehind_m = 60.0;
  constexpr double kSeenAhead_m = 170.0;
  constexpr int kBeside = 30;  // what is ahead must not stand in the street just behind the camera
  const int here = std::clamp(static_cast<int>(arc_m / kKnotSpacing_m), 0, road.num_knots() - 1);
  const int last = last_clear_knot(road, std::max(here - kBeside, 0), here, 1, kSeenAhead_m);
  return {last_clear_knot(road, last, here, -1, kSeenBehind_m), last + 1};
}

Scene build_street(const RoadCurve& road,
                   double arc_m,
                   const Vec3& camera_position,
                   const Vec3& to_sun,
                   std::uint64_t seed) {
  constexpr double kAmbient = 0.36;
  Scene scene(camera_position, to_sun, kAmbient);
  const double texture_origin_m = std::floor(arc_m / kTexturePeriod_m) * kTexturePeriod_m;
  const Street street{road, visible_window(road, arc_m), texture_origin_m, seed, scene};
  add_ground(street);
  add_borders(street);
  add_buildings(street);
  add_plants(street);
  add_poles(street);
  add_parked_cars(street);
  return scene;
}

}  // namespace stemvo::synth
