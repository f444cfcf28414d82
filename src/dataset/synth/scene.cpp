// SPDX-License-Identifier: MIT
#include "dataset/synth/scene.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

namespace stemvo::synth {
namespace {

constexpr double kSeenBehind_m = 60.0;
constexpr double kSeenAhead_m = 170.0;

/// Last knot from `start` in direction `step` before the road comes back near the way from `from`,
/// a knot on the other side of `start`.
int walk(const RoadCurve& road, int from, int start, int step, double reach_m) {
  constexpr double kClear_m = 2.0 * kStreetHalfWidth_m;
  constexpr int kNeighbours = 45;  // knots: nearer ones are the same street
  const int count = static_cast<int>(reach_m / kKnotSpacing_m);
  for (int k = 0; k < count; ++k) {
    const int i = start + step * (k + 1);
    if (i < 0 || i >= road.num_knots()) {
      return i - step;
    }
    for (int j = from; (i - j) * step >= kNeighbours; j += step) {
      if ((road.knot(i).position - road.knot(j).position).norm() < kClear_m) {
        return i - step;
      }
    }
  }
  return start + step * count;
}

}  // namespace

RoadWindow visible_window(const RoadCurve& road, double arc_m) {
  const int here = std::clamp(static_cast<int>(arc_m / kKnotSpacing_m), 0, road.num_knots() - 1);
  constexpr int kBeside = 30;  // what is ahead must not stand in the street just behind the camera
  const int last = walk(road, std::max(here - kBeside, 0), here, 1, kSeenAhead_m);
  return {walk(road, last, here, -1, kSeenBehind_m), last + 1};
}

void Scene::add_polygon(std::span<const Eigen::Vector3d> corners,
                        std::span<const Eigen::Vector2d> texture,
                        const Style& style) {
  constexpr double kSun = 0.95;
  Face face;
  face.num_points = static_cast<int>(corners.size());
  for (std::size_t i = 0; i < corners.size(); ++i) {
    face.points[i] = (corners[i] - origin_).cast<float>();
  }
  for (std::size_t i = 0; i < 3; ++i) {
    face.texture[i] = texture[i].cast<float>();
  }
  face.style = style;
  Eigen::Vector3d normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalized();
  if (normal.dot(corners[0] - origin_) > 0.0) {
    normal = -normal;  // towards the camera
  }
  const double sky = 0.12 * -normal.y();
  const double light = ambient_ + sky + kSun * std::max(0.0, normal.dot(to_sun_));
  face.style.light = static_cast<float>(light * static_cast<double>(style.light));
  faces_.push_back(face);
}

void Scene::add_quad(const std::array<Eigen::Vector3d, 4>& corners,
                     const std::array<Eigen::Vector2d, 3>& texture,
                     const Style& style) {
  add_polygon(corners, texture, style);
}

void Scene::add_patch(const std::array<Eigen::Vector3d, 4>& corners,
                      const std::array<Eigen::Vector2d, 4>& texture,
                      const Style& style) {
  const auto triangle = [&](std::size_t a, std::size_t b, std::size_t c) {
    add_polygon(std::array{corners[a], corners[b], corners[c]},
                std::array{texture[a], texture[b], texture[c]}, style);
  };
  triangle(0, 1, 2);
  triangle(0, 2, 3);
}

void Scene::add_prism(const Eigen::Vector3d& foot,
                      const Eigen::Vector3d& up,
                      double radius_m,
                      double height_m,
                      const Style& style) {
  constexpr int kSides = 6;
  const Eigen::Vector3d x = up.unitOrthogonal();
  const Eigen::Vector3d y = up.cross(x);
  const auto rim = [&](int i, double height) -> Eigen::Vector3d {
    const double angle = 2.0 * std::numbers::pi * i / kSides;
    return foot + radius_m * (std::cos(angle) * x + std::sin(angle) * y) + height * up;
  };
  const double width_m = 2.0 * radius_m * std::sin(std::numbers::pi / kSides);
  for (int i = 0; i < kSides; ++i) {
    const int j = (i + 1) % kSides;
    add_quad({rim(i, 0.0), rim(j, 0.0), rim(j, height_m), rim(i, height_m)},
             {Eigen::Vector2d(i * width_m, 0.0), Eigen::Vector2d((i + 1) * width_m, 0.0),
              Eigen::Vector2d((i + 1) * width_m, height_m)},
             style);
  }
}

void Scene::add_box(const Eigen::Vector3d& corner,
                    const std::array<Eigen::Vector3d, 3>& edges,
                    const Style& style) {
  double begin_m = 0.0;  // each side has a texture of its own, not its neighbour's mirrored
  const auto side = [&](const Eigen::Vector3d& at, const Eigen::Vector3d& u,
                        const Eigen::Vector3d& v) {
    add_quad({at, at + u, at + u + v, at + v},
             {Eigen::Vector2d(begin_m, 0), Eigen::Vector2d(begin_m + u.norm(), 0),
              Eigen::Vector2d(begin_m + u.norm(), v.norm())},
             style);
    begin_m += 2.3;
  };
  const auto& [along, across, up] = edges;
  side(corner, along, up);
  side(corner + across, along, up);
  side(corner, across, up);
  side(corner + along, across, up);
  side(corner + up, along, across);
}

Scene build_scene(const RoadCurve& road,
                  double arc_m,
                  const Eigen::Vector3d& camera_position,
                  const Eigen::Vector3d& to_sun,
                  std::uint64_t seed) {
  constexpr double kAmbient = 0.36;
  Scene scene(camera_position, to_sun, kAmbient);
  const StreetContext street{road, visible_window(road, arc_m),
                             std::floor(arc_m / kTexturePeriod_m) * kTexturePeriod_m, seed};
  add_ground(street, scene);
  add_borders(street, scene);
  add_buildings(street, scene);
  add_trees(street, scene);
  add_bushes(street, scene);
  add_poles(street, scene);
  add_parked_cars(street, scene);
  return scene;
}

}  // namespace stemvo::synth
