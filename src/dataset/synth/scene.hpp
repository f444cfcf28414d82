// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "dataset/synth/hash.hpp"
#include "dataset/synth/road_curve.hpp"

namespace stemvo::synth {

enum class Material : std::uint8_t {
  kAsphalt,  // u along the road, v across it
  kParking,  // small paving stones
  kKerb,
  kSidewalk,
  kGrass,
  kFacade,  // u along the wall, v upwards from the ground
  kPlainWall,
  kRoof,  // v up the slope
  kHedge,
  kFence,
  kBark,
  kLeaves,
  kPaint,      // cars, poles, signs: one colour
  kNearHedge,  // one that is looked at from a step away
  kBrick,
  kBoards,  // upright planks
};

/// How a face is painted; the meaning of `size` depends on the material.
struct Style {
  Material material = Material::kPaint;
  std::array<float, 3> albedo = {0.5F, 0.5F, 0.5F};  ///< RGB
  float light = 1.0F;                                ///< from its normal: 1 is full sun
  std::uint32_t seed = 0;
  std::array<float, 2> size = {0.0F, 0.0F};  ///< facade: length and height in metres
};

/// A flat convex polygon. Points in world axes from the camera's centre (metres): differences are
/// taken in double, so that float is exact enough at any distance from the world's origin.
struct Face {
  std::array<Eigen::Vector3f, 4> points;
  std::array<Eigen::Vector2f, 3> texture;  ///< metres, at the first three points; affine on it
  int num_points = 0;
  Style style;
};

/// What is near one frame: part of a street, or a courtyard.
class Scene {
 public:
  /// `ambient`: light on what the sun does not reach.
  Scene(const Eigen::Vector3d& origin, const Eigen::Vector3d& to_sun, double ambient)
      : origin_(origin), to_sun_(to_sun), ambient_(ambient) {}

  [[nodiscard]] const std::vector<Face>& faces() const { return faces_; }

  /// Corners in order; texture coordinates at the first three. `light` is set from the normal on
  /// the side of the camera; `style.light` multiplies it.
  void add_quad(const std::array<Eigen::Vector3d, 4>& corners,
                const std::array<Eigen::Vector2d, 3>& texture,
                const Style& style);
  /// A quad that may be warped, as two triangles; texture at all four corners.
  void add_patch(const std::array<Eigen::Vector3d, 4>& corners,
                 const std::array<Eigen::Vector2d, 4>& texture,
                 const Style& style);
  /// A prism around a vertical axis: trunk, pole.
  void add_prism(const Eigen::Vector3d& foot,
                 const Eigen::Vector3d& up,
                 double radius_m,
                 double height_m,
                 const Style& style);
  /// Five sides of a box (no floor), `axes` are its full edges from `corner`: along, across, up.
  void add_box(const Eigen::Vector3d& corner,
               const std::array<Eigen::Vector3d, 3>& edges,
               const Style& style);

 private:
  void add_polygon(std::span<const Eigen::Vector3d> corners,
                   std::span<const Eigen::Vector2d> texture,
                   const Style& style);

  Eigen::Vector3d origin_;
  Eigen::Vector3d to_sun_;
  double ambient_;
  std::vector<Face> faces_;
};

/// Part of a road that is drawn: knots [begin, end).
struct RoadWindow {
  int begin = 0;
  int end = 0;
};

/// 60 m behind and 170 m ahead of `arc_m`, less where the road comes back to itself: what would
/// stand in the way of the street the camera is in is not there.
[[nodiscard]] RoadWindow visible_window(const RoadCurve& road, double arc_m);

/// Texture coordinates along the road start anew at multiples of this: float stays exact.
inline constexpr double kTexturePeriod_m = 61.44;

/// All that a builder of things along the road needs.
struct StreetContext {
  const RoadCurve& road;
  RoadWindow window;
  double texture_origin_m;  ///< arc length where u = 0
  std::uint64_t seed;
};

void add_ground(const StreetContext& street, Scene& scene);
void add_borders(const StreetContext& street, Scene& scene);  // hedges, walls, fences
void add_buildings(const StreetContext& street, Scene& scene);
void add_trees(const StreetContext& street, Scene& scene);
void add_bushes(const StreetContext& street, Scene& scene);
void add_poles(const StreetContext& street, Scene& scene);
void add_parked_cars(const StreetContext& street, Scene& scene);

/// Overlapping balls of leaves of different size and tone, with loose leaves.
void add_crown(
    const Eigen::Vector3d& centre, double radius_m, double stretch, Draw draw, Scene& scene);

/// Calls build(slot, arc_m) for every slot of `length_m` that touches the window; slots are
/// numbered along the whole road, so that a thing is the same from wherever it is seen.
template <typename Build>
void for_each_slot(const StreetContext& street, double length_m, const Build& build) {
  const int first = static_cast<int>(street.window.begin * kKnotSpacing_m / length_m);
  const int last = static_cast<int>((street.window.end - 1) * kKnotSpacing_m / length_m);
  for (int slot = first; slot <= last; ++slot) {
    const double arc_m = slot * length_m;
    if (arc_m >= street.window.begin * kKnotSpacing_m &&
        arc_m + length_m <= (street.window.end - 1) * kKnotSpacing_m) {
      build(slot, arc_m);
    }
  }
}

/// The whole street near `arc_m`, seen from `camera_position`.
[[nodiscard]] Scene build_scene(const RoadCurve& road,
                                double arc_m,
                                const Eigen::Vector3d& camera_position,
                                const Eigen::Vector3d& to_sun,
                                std::uint64_t seed);

}  // namespace stemvo::synth
