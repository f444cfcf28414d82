// SPDX-License-Identifier: MIT
#include "synth/scene.hpp"

#include <algorithm>

namespace stemvo::synth {

void Scene::add_face(std::initializer_list<Vec3> corners,
                     std::initializer_list<Vec2> texture,
                     const Style& style) {
  constexpr double kSun = 0.95;
  Face face;
  face.num_points = static_cast<int>(corners.size());
  std::ranges::transform(corners, face.points.begin(), [&](const Vec3& corner) {
    return (corner - origin_).cast<float>().eval();
  });
  std::ranges::transform(texture, face.texture.begin(),
                         [](const Vec2& uv) { return uv.cast<float>().eval(); });
  face.style = style;
  const Vec3* at = corners.begin();
  Vec3 normal = (at[1] - at[0]).cross(at[2] - at[0]).normalized();
  if (normal.dot(at[0] - origin_) > 0.0) {
    normal = -normal;  // towards the camera
  }
  const double sky = 0.12 * -normal.y();
  const double light = ambient_ + sky + kSun * std::max(0.0, normal.dot(to_sun_));
  face.style.light = static_cast<float>(light * static_cast<double>(style.light));
  faces_.push_back(face);
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

}  // namespace stemvo::synth
