// SPDX-License-Identifier: MIT
#include "dataset/synth/hash.hpp"
#include "dataset/synth/scene.hpp"

namespace stemvo::synth {
namespace {

/// A strip between two lines along the road; lateral distances to the right of the camera's path,
/// which runs in the right lane.
struct Strip {
  double left_m;
  double left_height_m;
  double right_m;
  double right_height_m;
  Material material;
  std::array<float, 3> albedo;
};

constexpr std::array<float, 3> kAsphaltGray = {0.345F, 0.345F, 0.35F};
constexpr std::array<float, 3> kStoneGray = {0.46F, 0.445F, 0.42F};
constexpr std::array<float, 3> kPavingGray = {0.43F, 0.41F, 0.39F};
constexpr std::array<float, 3> kGrassGreen = {0.24F, 0.32F, 0.13F};
constexpr std::array<float, 3> kParkingGray = {0.38F, 0.365F, 0.355F};

constexpr double kKerb_m = 0.12;

constexpr std::array<Strip, 9> kStrips = {{
    {-kStreetHalfWidth_m, 0.25, -7.2, kKerb_m, Material::kGrass, kGrassGreen},
    {-7.2, kKerb_m, -5.35, kKerb_m, Material::kSidewalk, kPavingGray},
    {-5.35, kKerb_m, -5.2, kKerb_m, Material::kKerb, kStoneGray},
    {-5.2, kKerb_m, -5.2, 0.0, Material::kKerb, kStoneGray},
    {-5.2, 0.0, 2.2, 0.0, Material::kAsphalt, kAsphaltGray},
    {2.2, 0.0, 4.4, 0.0, Material::kParking, kParkingGray},
    {4.4, 0.0, 4.4, kKerb_m, Material::kKerb, kStoneGray},
    {4.4, kKerb_m, 6.6, kKerb_m, Material::kSidewalk, kPavingGray},
    {6.6, kKerb_m, kStreetHalfWidth_m, 0.25, Material::kGrass, kGrassGreen},
}};

void add_strip(const StreetContext& street, const Strip& strip, Scene& scene) {
  const bool is_upright = strip.left_m == strip.right_m;
  const double v_left = is_upright ? strip.left_height_m : strip.left_m;
  const double v_right = is_upright ? strip.right_height_m : strip.right_m;
  Style style;
  style.material = strip.material;
  style.albedo = strip.albedo;
  style.seed = static_cast<std::uint32_t>(hash_of(street.seed, 'G'));
  for (int i = street.window.begin; i + 1 < street.window.end; ++i) {
    const RoadFrame& a = street.road.knot(i);
    const RoadFrame& b = street.road.knot(i + 1);
    const double u = i * kKnotSpacing_m - street.texture_origin_m;
    scene.add_patch(
        {a.point(strip.left_m, strip.left_height_m), a.point(strip.right_m, strip.right_height_m),
         b.point(strip.right_m, strip.right_height_m), b.point(strip.left_m, strip.left_height_m)},
        {Eigen::Vector2d(u, v_left), Eigen::Vector2d(u, v_right),
         Eigen::Vector2d(u + kKnotSpacing_m, v_right), Eigen::Vector2d(u + kKnotSpacing_m, v_left)},
        style);
  }
}

/// Hedge, garden wall or fence at the outer edge, a new kind every 16 m or so.
void add_border(const StreetContext& street, double side, Scene& scene) {
  const double lateral_m = side * kStreetHalfWidth_m;
  for (int i = street.window.begin; i + 1 < street.window.end; ++i) {
    Draw draw(street.seed, 'B', side > 0.0, i / 16);
    Style style;
    style.seed = draw.bits();
    const double kind = draw.next();
    double height_m = draw.in(1.9, 3.2);
    if (kind < 0.6) {
      style.material = Material::kHedge;
      style.albedo = {0.15F, 0.22F, 0.09F};
    } else if (kind < 0.8) {
      style.material = Material::kPlainWall;
      style.albedo = {0.55F, 0.52F, 0.48F};
      height_m *= 0.8;
    } else {
      style.material = Material::kFence;
      style.albedo = {0.33F, 0.25F, 0.17F};
      height_m *= 0.75;
    }
    const RoadFrame& a = street.road.knot(i);
    const RoadFrame& b = street.road.knot(i + 1);
    const double u = i * kKnotSpacing_m - street.texture_origin_m;
    scene.add_patch({a.point(lateral_m, 0.0), b.point(lateral_m, 0.0), b.point(lateral_m, height_m),
                     a.point(lateral_m, height_m)},
                    {Eigen::Vector2d(u, 0.0), Eigen::Vector2d(u + kKnotSpacing_m, 0.0),
                     Eigen::Vector2d(u + kKnotSpacing_m, height_m), Eigen::Vector2d(u, height_m)},
                    style);
  }
}

}  // namespace

void add_ground(const StreetContext& street, Scene& scene) {
  for (const Strip& strip : kStrips) {
    add_strip(street, strip, scene);
  }
}

void add_borders(const StreetContext& street, Scene& scene) {
  add_border(street, -1.0, scene);
  add_border(street, 1.0, scene);
}

}  // namespace stemvo::synth
