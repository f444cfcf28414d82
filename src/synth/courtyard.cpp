// SPDX-License-Identifier: MIT
#include <algorithm>
#include <numeric>

#include "synth/drive.hpp"
#include "synth/materials.hpp"

namespace stemvo::synth {
namespace {

constexpr double kWallDepth_m = 0.6;
constexpr double kMaxRelief_m = 0.22;  // how far a wall's part stands out
/// No surface is nearer than this to the middle of a walkway, 0.4 m more beyond its ends.
constexpr double kWalkwayClear_m = 0.86;

/// A thing's room: x from 0 to width, y from 0 to depth.
struct Room {
  double width_m;
  double depth_m;
};

/// A thing stands at the origin of its own axes. `along` points to the right of a viewer of its
/// front, `out` towards him, up is -y.
struct Stand {
  Scene& scene;
  Vec3 origin;
  Vec3 along;
  Vec3 out;

  [[nodiscard]] Vec3 at(double x, double y, double height) const {
    return origin + x * along + y * out - height * Vec3::UnitY();
  }
  /// The same axes elsewhere, turned to the right by `turn_rad`.
  [[nodiscard]] Stand moved(double x, double y, double height, double turn_rad = 0.0) const {
    return {scene, at(x, y, height), std::cos(turn_rad) * along + std::sin(turn_rad) * out,
            std::cos(turn_rad) * out - std::sin(turn_rad) * along};
  }
  void add_block(const Room& room, double height_m, const Style& style) const {
    scene.add_box(origin, {room.width_m * along, room.depth_m * out, -height_m * Vec3::UnitY()},
                  style);
  }
  /// A flat rectangle parallel to the front, `off_m` before it; x and height of its corner.
  void add_sheet(const Vec2& corner, const Vec2& size, double off_m, const Style& style) const {
    const auto& [left, low] = std::pair(corner.x(), corner.y());
    const auto& [right, top] = std::pair(left + size.x(), low + size.y());
    scene.add_face(
        {at(left, off_m, low), at(right, off_m, low), at(right, off_m, top), at(left, off_m, top)},
        {Vec2(0, 0), Vec2(size.x(), 0), size}, style);
  }
};

Style any_colour(Draw& draw) {
  const float light = draw.in_float(0.12, 0.75);
  const auto tint = [&] { return draw.in_float(0.5, 1.2); };
  return {.albedo = Rgb{tint(), tint(), tint()} * light};
}

Style brick_style(Draw& draw) {
  const std::uint32_t seed = draw.bits();
  const auto hue = static_cast<float>(draw.next());
  return {.material = materials::brick,
          .seed = seed,
          .albedo = {0.36F + 0.12F * hue, 0.21F + 0.17F * hue, 0.15F + 0.15F * hue}};
}

Style board_style(Draw& draw) {
  return {.material = materials::boards,
          .seed = draw.bits(),
          .albedo = Rgb{0.42F, 0.32F, 0.21F} * draw.in_float(0.6, 1.3)};
}

Style hedge_style(Draw& draw) {
  return {.material = materials::near_hedge,
          .seed = draw.bits(),
          .albedo = {draw.in_float(0.13, 0.2), 0.24F, 0.09F}};
}

/// A sheet with an image of a few rectangles above lines of writing.
void add_notice(const Stand& stand, const Vec2& corner, const Vec2& size, Draw& draw) {
  constexpr double kOff_m = 0.01;
  constexpr double kLayer_m = 0.002;
  const float paper = draw.in_float(0.4, 0.64);
  stand.add_sheet(corner, size, kOff_m, {.albedo = {paper, paper, 0.92F * paper}});
  const double split = corner.y() + draw.in(0.3, 0.7) * size.y();
  const double border = 0.06 * size.x();
  for (int i = 0; i < 4; ++i) {
    const double width = size.x() * draw.in(0.15, 0.55);
    const double height = (corner.y() + size.y() - split) * draw.in(0.2, 0.7);
    const Style style = any_colour(draw);
    const double x = corner.x() + draw.in(border, size.x() - width - border);
    const double y = split + draw.in(0.0, 0.95) * (corner.y() + size.y() - split - height);
    stand.add_sheet({x, y}, {width, height}, kOff_m + kLayer_m * (i + 1), style);
  }
  const double line_m = draw.in(0.03, 0.06);
  for (double y = split - line_m; y > corner.y() + line_m; y -= line_m) {
    double x = corner.x() + border;
    while (x < corner.x() + 0.8 * size.x()) {  // words
      const double word_m = std::min(draw.in(0.03, 0.14), corner.x() + size.x() - border - x);
      const float ink = draw.in_float(0.05, 0.2);
      stand.add_sheet({x, y}, {word_m, 0.45 * line_m}, kOff_m + kLayer_m,
                      {.albedo = {ink, ink, ink}});
      x += word_m + draw.in(0.015, 0.04);
    }
  }
}

/// Sheets of paper with lines and images, 1 cm before a wall, between 0.5 m and 2.4 m.
void add_notices(const Stand& stand, double width_m, Draw draw) {
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
        add_notice(stand, {x + draw.in(-0.02, 0.02), low}, {sheet_m, tall_m}, draw);
      }
      low += tall_m + draw.in(0.05, 0.3);
    }
    x += sheet_m + draw.in(0.08, 0.35);
  }
}

void add_brick_pillar(const Stand& stand, const Room& room, Draw draw) {
  const Style style = brick_style(draw);
  constexpr double kCap_m = 0.05;
  const double width_m = std::min(room.width_m, draw.in(0.4, 0.6)) - 2.0 * kCap_m;
  const double depth_m = std::min(room.depth_m, draw.in(0.4, 0.6)) - 2.0 * kCap_m;
  const double x = 0.5 * (room.width_m - width_m);
  const double height_m = draw.in(2.2, 3.6);
  stand.moved(x, kCap_m, 0.0).add_block({width_m, depth_m}, height_m, style);
  const Style stone{.material = materials::kerb, .albedo = {0.5F, 0.48F, 0.45F}};
  const Room wide{width_m + 2.0 * kCap_m, depth_m + 2.0 * kCap_m};
  stand.moved(x - kCap_m, 0.0, height_m).add_block(wide, 0.12, stone);
  stand.moved(x - kCap_m, 0.0, 0.0).add_block(wide, 0.25, stone);
}

void add_crates(const Stand& stand, const Room& room, Draw draw) {
  double height_m = 0.0;
  const double full_m = draw.in(1.3, 2.0);
  while (height_m < full_m) {
    Style style = board_style(draw);
    if (draw.chance(0.3)) {
      style.albedo = any_colour(draw).albedo;
    }
    const double rise_m = draw.in(0.3, 0.55);
    const double width_m = room.width_m * draw.in(0.65, 0.92);
    const double depth_m = room.depth_m * draw.in(0.65, 0.92);
    const double turn_rad = draw.in(-0.08, 0.08);  // about the middle
    const Stand corner = stand.moved(0.5 * room.width_m, 0.5 * room.depth_m, height_m, turn_rad)
                             .moved(-0.5 * width_m, -0.5 * depth_m, 0.0);
    corner.add_block({width_m, depth_m}, rise_m, style);
    add_notice(corner.moved(0.0, depth_m - 0.006, 0.0), {0.15 * width_m, 0.2 * rise_m},
               {0.4 * width_m, 0.5 * rise_m}, draw);
    height_m += rise_m;
  }
}

void add_planter(const Stand& stand, const Room& room, Draw draw) {
  const Material material = draw.chance(0.5) ? materials::kerb : materials::boards;
  const Style trough{.material = material, .seed = draw.bits(), .albedo = {0.45F, 0.42F, 0.38F}};
  const double trough_m = draw.in(0.35, 0.55);
  stand.add_block(room, trough_m, trough);
  double x = 0.03;
  while (x < room.width_m - 0.2) {
    const double width_m = std::min(draw.in(0.25, 0.6), room.width_m - 0.03 - x);
    const double inset_m = draw.in(0.03, 0.1);
    const Style hedge = hedge_style(draw);
    stand.moved(x, inset_m, trough_m)
        .add_block({width_m, room.depth_m - 2.0 * inset_m}, draw.in(0.6, 1.4), hedge);
    x += width_m;
  }
}

/// Boards between uprights, with boxes of all colours on them; open to both sides.
void add_shelves(const Stand& stand, const Room& room, Draw draw) {
  const Style wood = board_style(draw);
  constexpr double kBoard_m = 0.025;
  const double height_m = draw.in(1.8, 2.3);
  const Room upright{kBoard_m, room.depth_m};
  stand.add_block(upright, height_m, wood);
  stand.moved(room.width_m - kBoard_m, 0.0, 0.0).add_block(upright, height_m, wood);
  const double spacing_m = draw.in(0.32, 0.42);
  const double inside_m = room.width_m - 2.0 * kBoard_m;
  for (double level = 0.12; level < height_m; level += spacing_m) {
    // Not as deep as the uprights: no two faces in one plane.
    const Stand board = stand.moved(kBoard_m, 0.004, level);
    board.add_block({inside_m, room.depth_m - 0.008}, kBoard_m, wood);
    for (double x = draw.in(0.01, 0.1); level + spacing_m < height_m && x < inside_m - 0.1;) {
      const double width_m = std::min(draw.in(0.04, 0.26), inside_m - 0.01 - x);
      const double front_m = draw.in(0.02, 0.12);
      const Style style = any_colour(draw);
      const double tall_m = draw.in(0.4, 0.9) * (spacing_m - kBoard_m);
      const double depth_m = room.depth_m - 2.0 * front_m;
      board.moved(x, front_m, kBoard_m).add_block({width_m, depth_m}, tall_m, style);
      if (width_m > 0.08) {
        board.moved(x, front_m + depth_m + 0.002, kBoard_m)
            .add_sheet({0.2 * width_m, 0.3 * tall_m}, {0.5 * width_m, 0.35 * tall_m}, 0.0,
                       any_colour(draw));
      }
      x += width_m + draw.in(0.005, 0.08);
    }
  }
}

constexpr std::array kThings = {add_brick_pillar, add_crates, add_planter, add_shelves};

struct WallKind {
  double min_height_m;
  double max_height_m;
  Style (*style)(Draw&);  ///< nullptr: plaster, with notices
};
constexpr std::size_t kHouse = 0;  // with windows and a door
constexpr std::array<WallKind, 5> kWallKinds = {{{6.0, 6.6, nullptr},
                                                 {3.6, 5.5, brick_style},
                                                 {3.2, 4.5, nullptr},
                                                 {2.3, 3.2, hedge_style},
                                                 {2.8, 3.8, board_style}}};

template <std::size_t N>
std::array<std::size_t, N> shuffled(Draw& draw) {
  std::array<std::size_t, N> order{};
  std::array<std::uint32_t, N> keys{};
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::generate(keys.begin(), keys.end(), [&] { return draw.bits(); });
  std::ranges::sort(order, {}, [&](std::size_t i) { return keys[i]; });
  return order;
}

/// One part of a wall: a block from behind the wall's line to `relief_m` before it.
void add_wall_part(const Stand& stand, double width_m, std::size_t kind, Draw draw) {
  const auto& [min_height_m, max_height_m, own_style] = kWallKinds[kind];
  const double relief_m = draw.in(0.0, kMaxRelief_m);
  Style style{.material = materials::plain_wall, .seed = draw.bits()};
  style.albedo = Rgb{0.48F, 0.45F, 0.38F} * draw.in_float(0.85, 1.15);
  if (own_style != nullptr) {
    style = own_style(draw);
  }
  const double height_m = draw.in(min_height_m, max_height_m);
  const double depth_m = kWallDepth_m + relief_m - (kind == kHouse ? 0.01 : 0.0);
  stand.moved(0.0, -kWallDepth_m, 0.0).add_block({width_m, depth_m}, height_m, style);
  const Stand front = stand.moved(0.0, relief_m, 0.0);
  if (kind == kHouse) {
    style.material = materials::facade;
    style.size = {static_cast<float>(width_m), static_cast<float>(height_m)};
    front.add_sheet({0.0, 0.0}, {width_m, height_m}, 0.0, style);
  }
  if (own_style == nullptr) {
    add_notices(front, width_m, draw);
  }
}

/// Four or five parts of different kinds. `stand`: at the wall's left end, on the floor.
void add_wall(const Stand& stand, double length_m, Draw draw) {
  const auto kinds = shuffled<kWallKinds.size()>(draw);
  std::vector<double> shares(draw.chance(0.5) ? 4 : 5);
  double sum = 0.0;
  for (std::size_t i = 0; i < shares.size(); ++i) {
    sum += shares[i] = draw.in(0.8, 1.2) * (kinds[i] == kHouse ? 1.8 : 1.0);
  }
  double x = 0.0;
  for (std::size_t i = 0; i < shares.size(); ++i) {
    const double width_m = shares[i] / sum * length_m;
    add_wall_part(stand.moved(x, 0.0, 0.0), width_m, kinds[i], Draw(draw.bits(), 'p', i));
    x += width_m;
  }
}

void add_blank_wall(const Stand& stand, double length_m, Draw draw) {
  const float light = draw.in_float(0.45, 0.62);
  stand.moved(0.0, -kWallDepth_m, 0.0)
      .add_block({length_m, kWallDepth_m + 0.5 * kMaxRelief_m}, draw.in(2.6, 3.4),
                 {.albedo = {light, 0.97F * light, 0.9F * light}});
}

void add_things_at_wall(const Stand& stand, double length_m, Draw draw) {
  constexpr double kMaxDepth_m = 0.45;
  double x = kMaxRelief_m + draw.in(0.1, 0.8);
  for (;;) {
    const Room room{draw.in(0.5, 1.3), draw.in(0.3, kMaxDepth_m)};
    if (x + room.width_m > length_m - kMaxRelief_m - 0.6) {
      return;
    }
    const std::size_t kind = draw.bits() % kThings.size();
    kThings[kind](stand.moved(x, kMaxRelief_m + 0.01, 0.0), room, Draw(draw.bits(), 't'));
    x += room.width_m + draw.in(0.3, 1.6);
  }
}

void add_trees_behind(const Stand& stand, double length_m, Draw draw) {
  for (double x = draw.in(0.5, 2.5); x < length_m; x += draw.in(3.0, 5.0)) {
    const Draw leaves(draw.bits(), 'c');
    const double stretch = draw.in(0.9, 1.3);
    const double radius_m = draw.in(1.1, 1.5);
    const Vec3 centre = stand.at(x, -kWallDepth_m - 1.8, draw.in(3.2, 4.5));
    add_crown(centre, radius_m, stretch, leaves, stand.scene);
  }
}

void add_floor(
    double left, double near, double right, double far, std::uint64_t seed, Scene& scene) {
  constexpr double kBorder_m = 1.1;
  const std::array<double, 4> x = {left, left + kBorder_m, right - kBorder_m, right};
  const std::array<double, 4> z = {near, near + kBorder_m, far - kBorder_m, far};
  const auto lay = [&](double x0, double z0, double x1, double z1, Material material) {
    const Style style{.material = material,
                      .seed = static_cast<std::uint32_t>(hash_of(seed, 'F')),
                      .albedo = {0.43F, 0.41F, 0.38F}};
    scene.add_face({Vec3(x0, 0, z0), Vec3(x1, 0, z0), Vec3(x1, 0, z1), Vec3(x0, 0, z1)},
                   {Vec2(x0, z0), Vec2(x1, z0), Vec2(x1, z1)}, style);
  };
  lay(x[1], z[1], x[2], z[2], materials::sidewalk);
  lay(x[0], z[0], x[3], z[1], materials::parking);
  lay(x[0], z[2], x[3], z[3], materials::parking);
  lay(x[0], z[1], x[1], z[2], materials::parking);
  lay(x[2], z[1], x[3], z[2], materials::parking);
}

}  // namespace

Courtyard lay_courtyard(std::uint64_t seed) {
  Draw draw(seed, 'Y');
  Courtyard yard{.seed = seed};
  for (auto* lines : {&yard.x_m, &yard.z_m}) {
    *lines = {-draw.in(2.15, 2.4), 0.0, draw.in(2.15, 2.4)};
  }
  for (double& wall : yard.wall_m) {
    wall = draw.in(2.0, 2.3);
  }
  return yard;
}

void add_courtyard(const Courtyard& courtyard, Scene& scene) {
  const double left = courtyard.x_m.front() - courtyard.wall_m[0];
  const double right = courtyard.x_m.back() + courtyard.wall_m[1];
  const double near = courtyard.z_m.front() - courtyard.wall_m[2];
  const double far = courtyard.z_m.back() + courtyard.wall_m[3];
  add_floor(left, near, right, far, courtyard.seed, scene);
  const Vec3 x = Vec3::UnitX();
  const Vec3 z = Vec3::UnitZ();
  const std::array<Stand, 4> sides = {{{scene, {left, 0.0, far}, x, -z},
                                       {scene, {right, 0.0, far}, -z, -x},
                                       {scene, {right, 0.0, near}, -x, z},
                                       {scene, {left, 0.0, near}, z, x}}};
  for (std::size_t i = 0; i < sides.size(); ++i) {
    const double length_m = i % 2 == 0 ? right - left : far - near;
    const auto& build_wall = courtyard.has_blank_walls ? add_blank_wall : add_wall;
    build_wall(sides[i], length_m, Draw(courtyard.seed, 'W', i));
    if (!courtyard.has_blank_walls || i % 2 == 1) {
      add_things_at_wall(sides[i], length_m, Draw(courtyard.seed, 'X', i));
      add_trees_behind(sides[i], length_m, Draw(courtyard.seed, 'Z', i));
    }
  }
  Draw draw(courtyard.seed, 'I');
  const auto kinds = shuffled<kThings.size()>(draw);
  for (std::size_t i = 0; i < kinds.size(); ++i) {  // between the walkways
    const auto& [x0, x1] = std::pair(courtyard.x_m[i % 2], courtyard.x_m[i % 2 + 1]);
    const auto& [z0, z1] = std::pair(courtyard.z_m[i / 2], courtyard.z_m[i / 2 + 1]);
    const Room room{x1 - x0 - 2.0 * kWalkwayClear_m, z1 - z0 - 2.0 * kWalkwayClear_m};
    const Vec3 corner(x0 + kWalkwayClear_m, 0.0, z0 + kWalkwayClear_m);
    kThings[kinds[i]]({scene, corner, x, z}, room, Draw(draw.bits(), 'i'));
  }
}

}  // namespace stemvo::synth
