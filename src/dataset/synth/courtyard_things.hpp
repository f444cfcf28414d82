// SPDX-License-Identifier: MIT
#pragma once

#include "dataset/synth/hash.hpp"
#include "dataset/synth/scene.hpp"

namespace stemvo::synth {

/// Where a thing stands: at the origin of its own axes. `along` to the right of who looks at its
/// front, `out` towards him, up is -y.
struct Stand {
  Eigen::Vector3d origin;
  Eigen::Vector3d along;
  Eigen::Vector3d out;

  [[nodiscard]] Eigen::Vector3d at(double x, double y, double height) const {
    return origin + x * along + y * out - height * Eigen::Vector3d::UnitY();
  }
  /// The same axes elsewhere, turned to the right by `turn_rad`.
  [[nodiscard]] Stand moved(double x, double y, double height, double turn_rad = 0.0) const;
};

/// How much room a thing has: x from 0 to width, y from 0 to depth.
struct Room {
  double width_m;
  double depth_m;
};

void add_block(
    const Stand& stand, const Room& room, double height_m, const Style& style, Scene& scene);

[[nodiscard]] Style brick_style(Draw& draw);
[[nodiscard]] Style board_style(Draw& draw);
[[nodiscard]] Style hedge_style(Draw& draw);

void add_brick_pillar(const Stand& stand, const Room& room, Draw draw, Scene& scene);
void add_crates(const Stand& stand, const Room& room, Draw draw, Scene& scene);
void add_planter(const Stand& stand, const Room& room, Draw draw, Scene& scene);
/// Boards between uprights, with boxes of all colours on them; open to both sides.
void add_shelves(const Stand& stand, const Room& room, Draw draw, Scene& scene);
/// Sheets of paper with lines and pictures, 1 cm before a wall, between 0.5 m and 2.4 m.
void add_notices(const Stand& stand, double width_m, Draw draw, Scene& scene);

}  // namespace stemvo::synth
