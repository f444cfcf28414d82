// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstdint>
#include <initializer_list>
#include <vector>

#include "synth/basics.hpp"

namespace stemvo::synth {

struct Sample;
/// Mean colour over a footprint, before light and haze.
using Material = Rgb (*)(const Sample& at);

struct Style {
  Material material = nullptr;  ///< nullptr: cars, poles, signs: one colour
  std::uint32_t seed = 0;
  Rgb albedo = {0.5F, 0.5F, 0.5F};
  float light = 1.0F;                        ///< from its normal: 1 is full sun
  std::array<float, 2> size = {0.0F, 0.0F};  ///< of a facade: length and height in metres
  bool moves = false;                        ///< on its own, at this moment
};

/// A flat convex polygon. Points in world axes from the camera's centre (metres): differences are
/// taken in double, so that float is exact enough at any distance from the world's origin.
struct Face {
  std::array<Eigen::Vector3f, 4> points;
  std::array<Eigen::Vector2f, 3> texture;  ///< metres, at the first three points; affine on it
  std::size_t num_points = 0;
  Style style;
};

/// Surroundings of one frame: part of a street, or a courtyard.
struct Scene {
  Vec3 origin;  ///< of the faces' points, in the world
  Vec3 to_sun;
  double ambient;  ///< light on what the sun does not reach
  std::vector<Face> faces = {};

  /// Three or four corners in order; texture coordinates at the first three. `light` is set from
  /// the normal on the side of the camera; `style.light` multiplies it.
  void add_face(std::initializer_list<Vec3> corners,
                std::initializer_list<Vec2> texture,
                const Style& style);
  /// A quad that may be warped, as two triangles; texture at all four corners.
  void add_patch(const std::array<Vec3, 4>& corners,
                 const std::array<Vec2, 4>& texture,
                 const Style& style);
  /// A prism around a vertical axis: trunk, pole.
  void add_prism(const Vec3& foot, double radius_m, double height_m, const Style& style);
  /// Five sides of a box (no floor), `edges` are its full edges from `corner`: along, across, up.
  void add_box(const Vec3& corner, const std::array<Vec3, 3>& edges, const Style& style);
};

/// Overlapping balls of leaves of different size and tone, with loose leaves.
void add_crown(const Vec3& centre, double radius_m, double stretch, Draw draw, Scene& scene);

}  // namespace stemvo::synth
