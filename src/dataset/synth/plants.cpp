// SPDX-License-Identifier: MIT
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

#include "dataset/synth/hash.hpp"
#include "dataset/synth/scene.hpp"

namespace stemvo::synth {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kRoomy = 0.75;  // plants stand only where a tight turn leaves the street its width

Eigen::Vector3d random_direction(Draw& draw) {
  const double z = draw.in(-1.0, 1.0);
  const double angle = draw.in(0.0, 2.0 * kPi);
  const double r = std::sqrt(1.0 - z * z);
  return {r * std::cos(angle), z, r * std::sin(angle)};
}

/// A ball of leaves with semi-axes `semi`.
void add_leaf_ball(const Eigen::Vector3d& centre,
                   const Eigen::Vector3d& semi,
                   const Style& style,
                   Scene& scene) {
  constexpr int kRings = 5;
  constexpr int kSectors = 8;
  const auto on_ball = [&](int ring, int sector) -> Eigen::Vector3d {
    const double polar = kPi * ring / kRings;
    const double angle = 2.0 * kPi * sector / kSectors;
    const Eigen::Vector3d direction(std::sin(polar) * std::cos(angle), -std::cos(polar),
                                    std::sin(polar) * std::sin(angle));
    return centre + semi.cwiseProduct(direction);
  };
  const auto texture = [&](int ring, int sector) {
    return Eigen::Vector2d(2.0 * kPi * semi.x() * sector / kSectors,
                           kPi * semi.y() * ring / kRings);
  };
  for (int ring = 0; ring < kRings; ++ring) {
    for (int sector = 0; sector < kSectors; ++sector) {
      scene.add_patch({on_ball(ring, sector), on_ball(ring, sector + 1),
                       on_ball(ring + 1, sector + 1), on_ball(ring + 1, sector)},
                      {texture(ring, sector), texture(ring, sector + 1),
                       texture(ring + 1, sector + 1), texture(ring + 1, sector)},
                      style);
    }
  }
}

/// Single leaves, as large as a hand or two, that make the outline of a ball ragged.
void add_loose_leaves(const Eigen::Vector3d& centre,
                      const Eigen::Vector3d& semi,
                      int count,
                      Style style,
                      Draw& draw,
                      Scene& scene) {
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3d outward = random_direction(draw);
    const Eigen::Vector3d at = centre + draw.in(0.9, 1.22) * semi.cwiseProduct(outward);
    const Eigen::Vector3d x = draw.in(0.07, 0.2) * random_direction(draw);
    const Eigen::Vector3d y =
        draw.in(0.07, 0.2) * (0.6 * outward + random_direction(draw)).cross(x).normalized();
    style.light = static_cast<float>(draw.in(0.4, 1.7));
    const double u = draw.in(0.0, 8.0);
    scene.add_quad(
        {at - x, at - 0.3 * x - y, at + x, at + 0.3 * x + y},
        {Eigen::Vector2d(u - x.norm(), 0), Eigen::Vector2d(u - 0.3 * x.norm(), -y.norm()),
         Eigen::Vector2d(u + x.norm(), 0)},
        style);
  }
}

}  // namespace

void add_crown(
    const Eigen::Vector3d& centre, double radius_m, double stretch, Draw draw, Scene& scene) {
  Style style;
  style.material = Material::kLeaves;
  const auto hue = static_cast<float>(draw.in(0.0, 1.0));
  style.albedo = {0.12F + 0.10F * hue, 0.19F + 0.02F * hue, 0.06F};
  constexpr int kBalls = 5;
  for (int i = 0; i < kBalls; ++i) {
    style.seed = draw.bits();
    style.light = static_cast<float>(draw.in(0.75, 1.25));
    const double size = i == 0 ? 0.72 : draw.in(0.4, 0.62);
    const Eigen::Vector3d semi = size * radius_m * Eigen::Vector3d(1.0, stretch, 1.0);
    Eigen::Vector3d at = centre;
    if (i > 0) {
      at +=
          0.55 * radius_m * Eigen::Vector3d(1.0, stretch, 1.0).cwiseProduct(random_direction(draw));
    }
    add_leaf_ball(at, semi, style, scene);
    add_loose_leaves(at, semi, static_cast<int>(50.0 * radius_m * size), style, draw, scene);
  }
}

namespace {

void add_tree(const StreetContext& street,
              double arc_m,
              double lateral_m,
              double size,
              Draw draw,
              Scene& scene) {
  const RoadFrame place = street.road.at(arc_m);
  if (place.squeeze(lateral_m) < kRoomy) {
    return;
  }
  Style bark;
  bark.material = Material::kBark;
  bark.albedo = {0.20F, 0.16F, 0.12F};
  bark.seed = draw.bits();
  const Eigen::Vector3d up = -Eigen::Vector3d::UnitY();
  const Eigen::Vector3d foot = place.point(lateral_m, -0.1);
  const double trunk_m = size * draw.in(1.8, 2.6);
  const double radius_m = size * draw.in(1.0, 1.6);
  const double stretch = draw.in(0.9, 1.5);
  scene.add_prism(foot, up, size * draw.in(0.08, 0.16), trunk_m + 0.6 * radius_m, bark);
  add_crown(foot + (trunk_m + 0.8 * radius_m * stretch) * up, radius_m, stretch, draw, scene);
}

}  // namespace

void add_trees(const StreetContext& street, Scene& scene) {
  for (const double side : {-1.0, 1.0}) {
    for_each_slot(street, 11.0, [&](int slot, double arc_m) {  // along the sidewalk
      Draw draw(street.seed, 'T', side > 0.0, slot);
      if (draw.chance(0.38)) {
        add_tree(street, arc_m + draw.in(1.0, 10.0), side * draw.in(6.9, 7.3), 1.0, draw, scene);
      }
    });
    for_each_slot(street, 7.0, [&](int slot, double arc_m) {  // in the gardens
      Draw draw(street.seed, 'D', side > 0.0, slot);
      if (draw.chance(0.75)) {
        add_tree(street, arc_m + draw.in(0.5, 6.5), side * draw.in(11.0, 14.0), draw.in(1.1, 2.2),
                 draw, scene);
      }
    });
  }
}

void add_bushes(const StreetContext& street, Scene& scene) {
  for (const double side : {-1.0, 1.0}) {
    for_each_slot(street, 2.4, [&](int slot, double arc_m) {  // before the houses and the hedge
      Draw draw(street.seed, 'b', side > 0.0, slot);
      const RoadFrame place = street.road.at(arc_m + draw.in(0.0, 2.4));
      const double lateral_m = side * (draw.chance(0.6) ? draw.in(7.3, 7.8) : draw.in(9.0, 12.5));
      if (!draw.chance(0.5) || place.squeeze(lateral_m) < kRoomy) {
        return;
      }
      const double radius_m = draw.in(0.25, 0.6);
      add_crown(place.point(lateral_m, 0.7 * radius_m), radius_m, draw.in(0.9, 1.6), draw, scene);
    });
  }
}

}  // namespace stemvo::synth
