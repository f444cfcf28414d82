// SPDX-License-Identifier: MIT
#include "dataset/synth/courtyard_things.hpp"

#include <algorithm>
#include <cmath>

namespace stemvo::synth {
namespace {

std::array<float, 3> any_colour(Draw& draw) {
  const auto light = static_cast<float>(draw.in(0.12, 0.75));
  std::array<float, 3> colour{};
  for (float& value : colour) {
    value = light * static_cast<float>(draw.in(0.5, 1.2));
  }
  return colour;
}

/// A flat rectangle parallel to the front, `off_m` before it.
void add_sheet(const Stand& stand,
               const std::array<double, 2>& corner,
               const std::array<double, 2>& size,
               double off_m,
               const std::array<float, 3>& colour,
               Scene& scene) {
  Style style;
  style.albedo = colour;
  const double right = corner[0] + size[0];
  const double top = corner[1] + size[1];
  scene.add_quad(
      {stand.at(corner[0], off_m, corner[1]), stand.at(right, off_m, corner[1]),
       stand.at(right, off_m, top), stand.at(corner[0], off_m, top)},
      {Eigen::Vector2d(0, 0), Eigen::Vector2d(size[0], 0), Eigen::Vector2d(size[0], size[1])},
      style);
}

/// A sheet with a picture of a few rectangles above lines of writing.
void add_notice(const Stand& stand,
                const std::array<double, 2>& corner,
                const std::array<double, 2>& size,
                Draw& draw,
                Scene& scene) {
  constexpr double kOff_m = 0.01;
  constexpr double kLayer_m = 0.002;
  const auto paper = static_cast<float>(draw.in(0.4, 0.64));
  add_sheet(stand, corner, size, kOff_m, {paper, paper, 0.92F * paper}, scene);
  const double split = corner[1] + draw.in(0.3, 0.7) * size[1];
  const double border = 0.06 * size[0];
  for (int i = 0; i < 4; ++i) {
    const double width = size[0] * draw.in(0.15, 0.55);
    const double height = (corner[1] + size[1] - split) * draw.in(0.2, 0.7);
    add_sheet(stand,
              {corner[0] + draw.in(border, size[0] - width - border),
               split + draw.in(0.0, 0.95) * (corner[1] + size[1] - split - height)},
              {width, height}, kOff_m + kLayer_m * (i + 1), any_colour(draw), scene);
  }
  const double line_m = draw.in(0.03, 0.06);
  for (double y = split - line_m; y > corner[1] + line_m; y -= line_m) {
    double x = corner[0] + border;
    while (x < corner[0] + 0.8 * size[0]) {  // words
      const double word_m = std::min(draw.in(0.03, 0.14), corner[0] + size[0] - border - x);
      const auto ink = static_cast<float>(draw.in(0.05, 0.2));
      add_sheet(stand, {x, y}, {word_m, 0.45 * line_m}, kOff_m + kLayer_m, {ink, ink, ink}, scene);
      x += word_m + draw.in(0.015, 0.04);
    }
  }
}

}  // namespace

Stand Stand::moved(double x, double y, double height, double turn_rad) const {
  return {at(x, y, height), std::cos(turn_rad) * along + std::sin(turn_rad) * out,
          std::cos(turn_rad) * out - std::sin(turn_rad) * along};
}

void add_block(
    const Stand& stand, const Room& room, double height_m, const Style& style, Scene& scene) {
  scene.add_box(
      stand.origin,
      {room.width_m * stand.along, room.depth_m * stand.out, -height_m * Eigen::Vector3d::UnitY()},
      style);
}

Style brick_style(Draw& draw) {
  Style style;
  style.material = Material::kBrick;
  style.seed = draw.bits();
  const auto hue = static_cast<float>(draw.next());
  style.albedo = {0.36F + 0.12F * hue, 0.21F + 0.17F * hue, 0.15F + 0.15F * hue};
  return style;
}

Style board_style(Draw& draw) {
  Style style;
  style.material = Material::kBoards;
  style.seed = draw.bits();
  const auto tone = static_cast<float>(draw.in(0.6, 1.3));
  style.albedo = {0.42F * tone, 0.32F * tone, 0.21F * tone};
  return style;
}

Style hedge_style(Draw& draw) {
  Style style;
  style.material = Material::kNearHedge;
  style.seed = draw.bits();
  style.albedo = {static_cast<float>(draw.in(0.13, 0.2)), 0.24F, 0.09F};
  return style;
}

void add_brick_pillar(const Stand& stand, const Room& room, Draw draw, Scene& scene) {
  const Style style = brick_style(draw);
  constexpr double kCap_m = 0.05;
  const double width_m = std::min(room.width_m, draw.in(0.4, 0.6)) - 2.0 * kCap_m;
  const double depth_m = std::min(room.depth_m, draw.in(0.4, 0.6)) - 2.0 * kCap_m;
  const double x = 0.5 * (room.width_m - width_m);
  const double height_m = draw.in(2.2, 3.6);
  add_block(stand.moved(x, kCap_m, 0.0), {width_m, depth_m}, height_m, style, scene);
  Style stone;
  stone.material = Material::kKerb;
  stone.albedo = {0.5F, 0.48F, 0.45F};
  const Room wide{width_m + 2.0 * kCap_m, depth_m + 2.0 * kCap_m};
  add_block(stand.moved(x - kCap_m, 0.0, height_m), wide, 0.12, stone, scene);
  add_block(stand.moved(x - kCap_m, 0.0, 0.0), wide, 0.25, stone, scene);
}

void add_crates(const Stand& stand, const Room& room, Draw draw, Scene& scene) {
  double height_m = 0.0;
  const double full_m = draw.in(1.3, 2.0);
  while (height_m < full_m) {
    Style style = board_style(draw);
    if (draw.chance(0.3)) {
      style.albedo = any_colour(draw);
    }
    const double rise_m = draw.in(0.3, 0.55);
    const double width_m = room.width_m * draw.in(0.65, 0.92);
    const double depth_m = room.depth_m * draw.in(0.65, 0.92);
    const double turn_rad = draw.in(-0.08, 0.08);  // about the middle
    const Stand middle = stand.moved(0.5 * room.width_m, 0.5 * room.depth_m, height_m, turn_rad);
    const Stand corner = middle.moved(-0.5 * width_m, -0.5 * depth_m, 0.0);
    add_block(corner, {width_m, depth_m}, rise_m, style, scene);
    add_notice(corner.moved(0.0, depth_m - 0.006, 0.0), {0.15 * width_m, 0.2 * rise_m},
               {0.4 * width_m, 0.5 * rise_m}, draw, scene);
    height_m += rise_m;
  }
}

void add_planter(const Stand& stand, const Room& room, Draw draw, Scene& scene) {
  Style stone;
  stone.material = draw.chance(0.5) ? Material::kKerb : Material::kBoards;
  stone.seed = draw.bits();
  stone.albedo = {0.45F, 0.42F, 0.38F};
  const double trough_m = draw.in(0.35, 0.55);
  add_block(stand, room, trough_m, stone, scene);
  double x = 0.03;
  while (x < room.width_m - 0.2) {
    const double width_m = std::min(draw.in(0.25, 0.6), room.width_m - 0.03 - x);
    const double inset_m = draw.in(0.03, 0.1);
    add_block(stand.moved(x, inset_m, trough_m), {width_m, room.depth_m - 2.0 * inset_m},
              draw.in(0.6, 1.4), hedge_style(draw), scene);
    x += width_m;
  }
}

void add_shelves(const Stand& stand, const Room& room, Draw draw, Scene& scene) {
  const Style wood = board_style(draw);
  constexpr double kBoard_m = 0.025;
  const double height_m = draw.in(1.8, 2.3);
  const Room upright{kBoard_m, room.depth_m};
  add_block(stand, upright, height_m, wood, scene);
  add_block(stand.moved(room.width_m - kBoard_m, 0.0, 0.0), upright, height_m, wood, scene);
  const double spacing_m = draw.in(0.32, 0.42);
  for (double level = 0.12; level < height_m; level += spacing_m) {
    // Not as deep as the uprights: no two faces in one plane.
    const Stand board = stand.moved(kBoard_m, 0.004, level);
    const double inside_m = room.width_m - 2.0 * kBoard_m;
    add_block(board, {inside_m, room.depth_m - 0.008}, kBoard_m, wood, scene);
    for (double x = draw.in(0.01, 0.1); level + spacing_m < height_m && x < inside_m - 0.1;) {
      const double width_m = std::min(draw.in(0.04, 0.26), inside_m - 0.01 - x);
      const double front_m = draw.in(0.02, 0.12);
      Style style;
      style.albedo = any_colour(draw);
      const double tall_m = draw.in(0.4, 0.9) * (spacing_m - kBoard_m);
      const double depth_m = room.depth_m - 2.0 * front_m;
      add_block(board.moved(x, front_m, kBoard_m), {width_m, depth_m}, tall_m, style, scene);
      if (width_m > 0.08) {
        add_sheet(board.moved(x, front_m + depth_m + 0.002, kBoard_m),
                  {0.2 * width_m, 0.3 * tall_m}, {0.5 * width_m, 0.35 * tall_m}, 0.0,
                  any_colour(draw), scene);
      }
      x += width_m + draw.in(0.005, 0.08);
    }
  }
}

void add_notices(const Stand& stand, double width_m, Draw draw, Scene& scene) {
  double x = draw.in(0.05, 0.25);
  for (;;) {
    const double sheet_m = draw.in(0.22, 0.6);
    if (x + sheet_m > width_m - 0.05) {
      return;
    }
    double low = draw.in(0.4, 1.0);
    for (;;) {
      const double tall_m = sheet_m * draw.in(0.8, 1.5);
      if (low + tall_m > 2.5) {
        break;
      }
      if (draw.chance(0.75)) {
        add_notice(stand, {x + draw.in(-0.02, 0.02), low}, {sheet_m, tall_m}, draw, scene);
      }
      low += tall_m + draw.in(0.05, 0.3);
    }
    x += sheet_m + draw.in(0.08, 0.35);
  }
}

}  // namespace stemvo::synth
