// SPDX-License-Identifier: MIT
#include "synth/scene.hpp"

#include <algorithm>

#include "synth/materials.hpp"

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
    // One draw a statement: in a product each compiler has its own order.
    Vec3 x = random_direction(draw);
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

}  // namespace

void Scene::add_face(std::initializer_list<Vec3> corners,
                     std::initializer_list<Vec2> texture,
                     const Style& style) {
  constexpr double kSun = 0.95;
  Face face;
  for (const Vec3& corner : corners) {
    face.points[face.num_points++] = (corner - origin).cast<float>();
  }
  for (std::size_t i = 0; i < face.texture.size(); ++i) {
    face.texture[i] = texture.begin()[i].cast<float>();
  }
  face.style = style;
  const Vec3* at = corners.begin();
  Vec3 normal = (at[1] - at[0]).cross(at[2] - at[0]).normalized();
  if (normal.dot(at[0] - origin) > 0.0) {
    normal = -normal;  // towards the camera
  }
  const double sky = 0.12 * -normal.y();
  const double light = ambient + sky + kSun * std::max(0.0, normal.dot(to_sun));
  face.style.light = static_cast<float>(light * static_cast<double>(style.light));
  faces.push_back(face);
}

void Scene::add_patch(const std::array<Vec3, 4>& corners,
                      const std::array<Vec2, 4>& texture,
                      const Style& style) {
  const auto& [a, b, c, d] = corners;
  const auto& [ta, tb, tc, td] = texture;
  add_face({a, b, c}, {ta, tb, tc}, style);
  add_face({a, c, d}, {ta, tc, td}, style);
}

void Scene::add_prism(const Vec3& foot, double radius_m, double height_m, const Style& style) {
  constexpr int kSides = 6;
  const Vec3 up = -Vec3::UnitY();
  const Vec3 x = up.unitOrthogonal();
  const Vec3 y = up.cross(x);
  const auto rim = [&](int i, double height) -> Vec3 {
    const double angle = 2.0 * kPi * i / kSides;
    return foot + radius_m * (std::cos(angle) * x + std::sin(angle) * y) + height * up;
  };
  const double width_m = 2.0 * radius_m * std::sin(kPi / kSides);
  for (int i = 0; i < kSides; ++i) {
    const int j = (i + 1) % kSides;
    const double left_m = i * width_m;
    const double right_m = (i + 1) * width_m;
    add_face({rim(i, 0.0), rim(j, 0.0), rim(j, height_m), rim(i, height_m)},
             {Vec2(left_m, 0.0), Vec2(right_m, 0.0), Vec2(right_m, height_m)}, style);
  }
}

void Scene::add_box(const Vec3& corner, const std::array<Vec3, 3>& edges, const Style& style) {
  double begin_m = 0.0;  // each side has a texture of its own, not its neighbour's mirrored
  const auto side = [&](const Vec3& at, const Vec3& u, const Vec3& v) {
    const double end_m = begin_m + u.norm();
    add_face({at, at + u, at + u + v, at + v},
             {Vec2(begin_m, 0), Vec2(end_m, 0), Vec2(end_m, v.norm())}, style);
    begin_m += 2.3;
  };
  const auto& [along, across, up] = edges;
  side(corner, along, up);
  side(corner + across, along, up);
  side(corner, across, up);
  side(corner + along, across, up);
  side(corner + up, along, across);
}

void add_crown(const Vec3& centre, double radius_m, double stretch, Draw draw, Scene& scene) {
  const float hue = draw.in_float(0.0, 1.0);
  Style style{.material = materials::leaves,
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

}  // namespace stemvo::synth
