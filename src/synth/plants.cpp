// SPDX-License-Identifier: MIT
#include "synth/materials.hpp"
#include "synth/street.hpp"

namespace stemvo::synth {
namespace {

Vec3 random_direction(Draw& draw) {
  const double z = draw.in(-1.0, 1.0);
  const double angle = draw.in(0.0, 2.0 * kPi);
  const double r = std::sqrt(1.0 - z * z);
  return {r * std::cos(angle), z, r * std::sin(angle)};
}

/// A ball of leaves with semi-axes `semi`.
void add_leaf_ball(const Vec3& centre, const Vec3& semi, const Style& style, Scene& scene) {
  constexpr int kRings = 5;
  constexpr int kSectors = 8;
  const auto point = [&](int ring, int sector) -> Vec3 {
    const double polar = kPi * ring / kRings;
    const double angle = 2.0 * kPi * sector / kSectors;
    const Vec3 direction(std::sin(polar) * std::cos(angle), -std::cos(polar),
                         std::sin(polar) * std::sin(angle));
    return centre + semi.cwiseProduct(direction);
  };
  const auto texture = [&](int ring, int sector) -> Vec2 {
    return {2.0 * kPi * semi.x() * sector / kSectors, kPi * semi.y() * ring / kRings};
  };
  for (int i = 0; i < kRings; ++i) {
    for (int k = 0; k < kSectors; ++k) {
      scene.add_patch({point(i, k), point(i, k + 1), point(i + 1, k + 1), point(i + 1, k)},
                      {texture(i, k), texture(i, k + 1), texture(i + 1, k + 1), texture(i + 1, k)},
                      style);
    }
  }
}

/// Single leaves, as large as a hand or two, that make the outline of a ball ragged.
void add_loose_leaves(
    const Vec3& centre, const Vec3& semi, int count, Style style, Draw& draw, Scene& scene) {
  for (int i = 0; i < count; ++i) {
    const Vec3 outward = random_direction(draw);
    const Vec3 at = centre + draw.in(0.9, 1.22) * semi.cwiseProduct(outward);
    Vec3 x = random_direction(
        draw);  // one draw a statement: in a product each compiler has its own order
    x *= draw.in(0.07, 0.2);
    Vec3 y = (0.6 * outward + random_direction(draw)).cross(x).normalized();
    y *= draw.in(0.07, 0.2);
    style.light = draw.in_float(0.4, 1.7);
    const double u = draw.in(0.0, 8.0);
    scene.add_face(
        {at - x, at - 0.3 * x - y, at + x, at + 0.3 * x + y},
        {Vec2(u - x.norm(), 0), Vec2(u - 0.3 * x.norm(), -y.norm()), Vec2(u + x.norm(), 0)}, style);
  }
}

void add_tree(const Street& street, double arc_m, double lateral_m, double size, Draw draw) {
  const RoadFrame place = street.road.at(arc_m);
  if (place.squeeze(lateral_m) < kRoomy) {
    return;
  }
  const Style bark{
      .material = &materials::kBark, .seed = draw.bits(), .albedo = {0.20F, 0.16F, 0.12F}};
  const Vec3 foot = place.point(lateral_m, -0.1);
  const double trunk_m = size * draw.in(1.8, 2.6);
  const double radius_m = size * draw.in(1.0, 1.6);
  const double stretch = draw.in(0.9, 1.5);
  street.scene.add_prism(foot, size * draw.in(0.08, 0.16), trunk_m + 0.6 * radius_m, bark);
  add_crown(foot - (trunk_m + 0.8 * radius_m * stretch) * Vec3::UnitY(), radius_m, stretch, draw,
            street.scene);
}

}  // namespace

void add_crown(const Vec3& centre, double radius_m, double stretch, Draw draw, Scene& scene) {
  const float hue = draw.in_float(0.0, 1.0);
  Style style{.material = &materials::kLeaves,
              .albedo = {0.12F + 0.10F * hue, 0.19F + 0.02F * hue, 0.06F}};
  constexpr int kBalls = 5;
  const Vec3 shape(1.0, stretch, 1.0);
  for (int i = 0; i < kBalls; ++i) {
    style.seed = draw.bits();
    style.light = draw.in_float(0.75, 1.25);
    const double size = i == 0 ? 0.72 : draw.in(0.4, 0.62);
    const Vec3 semi = size * radius_m * shape;
    Vec3 at = centre;
    if (i > 0) {
      at += 0.55 * radius_m * shape.cwiseProduct(random_direction(draw));
    }
    add_leaf_ball(at, semi, style, scene);
    add_loose_leaves(at, semi, static_cast<int>(50.0 * radius_m * size), style, draw, scene);
  }
}

void add_plants(const Street& street) {
  for (const double side : {-1.0, 1.0}) {
    street.for_each_lot('T', side, 11.0, [&](Draw draw, double arc_m) {  // along the sidewalk
      if (draw.chance(0.38)) {
        const double lateral_m = side * draw.in(6.9, 7.3);
        const double tree_m = arc_m + draw.in(1.0, 10.0);
        add_tree(street, tree_m, lateral_m, 1.0, draw);
      }
    });
    street.for_each_lot('D', side, 7.0, [&](Draw draw, double arc_m) {  // in the gardens
      if (draw.chance(0.75)) {
        const double size = draw.in(1.1, 2.2);
        const double lateral_m = side * draw.in(11.0, 14.0);
        const double tree_m = arc_m + draw.in(0.5, 6.5);
        add_tree(street, tree_m, lateral_m, size, draw);
      }
    });
  }
  for (const double side : {-1.0, 1.0}) {
    street.for_each_lot('b', side, 2.4, [&](Draw draw, double arc_m) {  // before house and hedge
      const RoadFrame place = street.road.at(arc_m + draw.in(0.0, 2.4));
      const double lateral_m = side * (draw.chance(0.6) ? draw.in(7.3, 7.8) : draw.in(9.0, 12.5));
      if (!draw.chance(0.5) || place.squeeze(lateral_m) < kRoomy) {
        return;
      }
      const double radius_m = draw.in(0.25, 0.6);
      const double stretch = draw.in(0.9, 1.6);
      add_crown(place.point(lateral_m, 0.7 * radius_m), radius_m, stretch, draw, street.scene);
    });
  }
}

}  // namespace stemvo::synth
