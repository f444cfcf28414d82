// SPDX-License-Identifier: MIT
#include "dataset/synth/courtyard.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "dataset/synth/courtyard_things.hpp"
#include "dataset/synth/hash.hpp"

namespace stemvo::synth {
namespace {

constexpr double kWallDepth_m = 0.6;
constexpr double kMaxRelief_m = 0.22;  // how far a wall's part stands out
constexpr double kThingDepth_m = 0.45;

struct Side {
  Stand stand;  ///< at the wall's left end, on the floor
  double length_m;
};

std::array<Side, 4> sides_of(const Courtyard& yard) {
  const double left = yard.x_m.front() - yard.wall_m[0];
  const double right = yard.x_m.back() + yard.wall_m[1];
  const double near = yard.z_m.front() - yard.wall_m[2];
  const double far = yard.z_m.back() + yard.wall_m[3];
  const Eigen::Vector3d x = Eigen::Vector3d::UnitX();
  const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();
  return {{{{{left, 0.0, far}, x, -z}, right - left},
           {{{right, 0.0, far}, -z, -x}, far - near},
           {{{right, 0.0, near}, -x, z}, right - left},
           {{{left, 0.0, near}, z, x}, far - near}}};
}

enum class Wall : std::uint8_t { kHouse, kBrick, kNotices, kHedge, kBoards };

/// 0 to N - 1 in a random order.
template <std::size_t N>
std::array<int, N> shuffled(Draw& draw) {
  std::array<int, N> order{};
  std::array<std::uint32_t, N> keys{};
  for (std::size_t i = 0; i < N; ++i) {
    order[i] = static_cast<int>(i);
    keys[i] = draw.bits();
  }
  std::sort(order.begin(), order.end(), [&](int a, int b) {
    return keys[static_cast<std::size_t>(a)] < keys[static_cast<std::size_t>(b)];
  });
  return order;
}

/// One part of a wall: a block from behind the wall's line to `relief_m` before it.
void add_wall_part(const Stand& stand, double width_m, Wall kind, Draw draw, Scene& scene) {
  const double relief_m = draw.in(0.0, kMaxRelief_m);
  const Stand back = stand.moved(0.0, -kWallDepth_m, 0.0);
  const Room room{width_m, kWallDepth_m + relief_m};
  const Stand front = stand.moved(0.0, relief_m, 0.0);
  Style plaster;
  plaster.material = Material::kPlainWall;
  plaster.seed = draw.bits();
  const auto tone = static_cast<float>(draw.in(0.85, 1.15));
  plaster.albedo = {0.48F * tone, 0.45F * tone, 0.38F * tone};
  switch (kind) {
    case Wall::kHouse: {
      const double height_m = draw.in(6.0, 6.6);
      add_block(back, {width_m, room.depth_m - 0.01}, height_m, plaster, scene);
      plaster.material = Material::kFacade;
      plaster.size = {static_cast<float>(width_m), static_cast<float>(height_m)};
      scene.add_quad(
          {front.at(0.0, 0.0, 0.0), front.at(width_m, 0.0, 0.0), front.at(width_m, 0.0, height_m),
           front.at(0.0, 0.0, height_m)},
          {Eigen::Vector2d(0, 0), Eigen::Vector2d(width_m, 0), Eigen::Vector2d(width_m, height_m)},
          plaster);
      add_notices(front, width_m, draw, scene);
      break;
    }
    case Wall::kBrick:
      add_block(back, room, draw.in(3.6, 5.5), brick_style(draw), scene);
      break;
    case Wall::kNotices:
      add_block(back, room, draw.in(3.2, 4.5), plaster, scene);
      add_notices(front, width_m, draw, scene);
      break;
    case Wall::kHedge:
      add_block(back, room, draw.in(2.3, 3.2), hedge_style(draw), scene);
      break;
    case Wall::kBoards:
      add_block(back, room, draw.in(2.8, 3.8), board_style(draw), scene);
      break;
  }
}

/// Four or five parts of different kinds.
void add_wall(const Side& side, Draw draw, Scene& scene) {
  const auto kinds = shuffled<5>(draw);
  const int count = draw.chance(0.5) ? 4 : 5;
  std::array<double, 5> share{};
  double sum = 0.0;
  for (int i = 0; i < count; ++i) {
    const bool is_house = kinds[static_cast<std::size_t>(i)] == static_cast<int>(Wall::kHouse);
    sum += share[static_cast<std::size_t>(i)] = draw.in(0.8, 1.2) * (is_house ? 1.8 : 1.0);
  }
  double x = 0.0;
  for (int i = 0; i < count; ++i) {
    const double width_m = share[static_cast<std::size_t>(i)] / sum * side.length_m;
    add_wall_part(side.stand.moved(x, 0.0, 0.0), width_m,
                  static_cast<Wall>(kinds[static_cast<std::size_t>(i)]), Draw(draw.bits(), 'p', i),
                  scene);
    x += width_m;
  }
}

using AddThing = void (*)(const Stand&, const Room&, Draw, Scene&);
constexpr std::array<AddThing, 4> kThings = {add_brick_pillar, add_crates, add_planter,
                                             add_shelves};

/// Things that stand before the wall, with gaps.
void add_things_at_wall(const Side& side, Draw draw, Scene& scene) {
  double x = kMaxRelief_m + draw.in(0.1, 0.8);
  for (;;) {
    const Room room{draw.in(0.5, 1.3), draw.in(0.3, kThingDepth_m)};
    if (x + room.width_m > side.length_m - kMaxRelief_m - 0.6) {
      return;
    }
    const auto kind = static_cast<std::size_t>(draw.bits() % kThings.size());
    kThings[kind](side.stand.moved(x, kMaxRelief_m + 0.01, 0.0), room, Draw(draw.bits(), 't'),
                  scene);
    x += room.width_m + draw.in(0.3, 1.6);
  }
}

/// One of each kind between the walkways.
void add_things_between(const Courtyard& yard, Scene& scene) {
  Draw draw(yard.seed, 'I');
  const auto kinds = shuffled<kThings.size()>(draw);
  for (std::size_t i = 0; i < kinds.size(); ++i) {
    const std::size_t column = i % 2;
    const std::size_t row = i / 2;
    const Room room{yard.x_m[column + 1] - yard.x_m[column] - 2.0 * kWalkwayClear_m,
                    yard.z_m[row + 1] - yard.z_m[row] - 2.0 * kWalkwayClear_m};
    const Stand stand{{yard.x_m[column] + kWalkwayClear_m, 0.0, yard.z_m[row] + kWalkwayClear_m},
                      Eigen::Vector3d::UnitX(),
                      Eigen::Vector3d::UnitZ()};
    kThings[static_cast<std::size_t>(kinds[i])](stand, room, Draw(draw.bits(), 'i'), scene);
  }
}

/// Large slabs, a border of small stones along the walls.
void add_floor(const Courtyard& yard, Scene& scene) {
  const double left = yard.x_m.front() - yard.wall_m[0];
  const double right = yard.x_m.back() + yard.wall_m[1];
  const double near = yard.z_m.front() - yard.wall_m[2];
  const double far = yard.z_m.back() + yard.wall_m[3];
  constexpr double kBorder_m = 1.1;
  const auto lay = [&](double x0, double z0, double x1, double z1, Material material) {
    Style style;
    style.material = material;
    style.seed = static_cast<std::uint32_t>(hash_of(yard.seed, 'F'));
    style.albedo = {0.43F, 0.41F, 0.38F};
    scene.add_quad({Eigen::Vector3d(x0, 0, z0), {x1, 0, z0}, {x1, 0, z1}, {x0, 0, z1}},
                   {Eigen::Vector2d(x0, z0), Eigen::Vector2d(x1, z0), Eigen::Vector2d(x1, z1)},
                   style);
  };
  lay(left + kBorder_m, near + kBorder_m, right - kBorder_m, far - kBorder_m, Material::kSidewalk);
  lay(left, near, right, near + kBorder_m, Material::kParking);
  lay(left, far - kBorder_m, right, far, Material::kParking);
  lay(left, near + kBorder_m, left + kBorder_m, far - kBorder_m, Material::kParking);
  lay(right - kBorder_m, near + kBorder_m, right, far - kBorder_m, Material::kParking);
}

/// Crowns that look over the walls.
void add_trees_behind(const Side& side, Draw draw, Scene& scene) {
  for (double x = draw.in(0.5, 2.5); x < side.length_m; x += draw.in(3.0, 5.0)) {
    add_crown(side.stand.at(x, -kWallDepth_m - 1.8, draw.in(3.2, 4.5)), draw.in(1.1, 1.5),
              draw.in(0.9, 1.3), Draw(draw.bits(), 'c'), scene);
  }
}

}  // namespace

Courtyard lay_courtyard(std::uint64_t seed) {
  Draw draw(seed, 'Y');
  Courtyard yard;
  yard.seed = seed;
  for (auto* lines : {&yard.x_m, &yard.z_m}) {
    *lines = {-draw.in(2.15, 2.4), 0.0, draw.in(2.15, 2.4)};
  }
  for (double& wall : yard.wall_m) {
    wall = draw.in(2.0, 2.3);
  }
  return yard;
}

Scene build_courtyard(const Courtyard& courtyard,
                      const Eigen::Vector3d& camera_position,
                      const Eigen::Vector3d& to_sun) {
  constexpr double kAmbient = 0.7;  // walls light each other
  Scene scene(camera_position, to_sun, kAmbient);
  add_floor(courtyard, scene);
  const auto sides = sides_of(courtyard);
  for (std::size_t i = 0; i < sides.size(); ++i) {
    add_wall(sides[i], Draw(courtyard.seed, 'W', i), scene);
    add_things_at_wall(sides[i], Draw(courtyard.seed, 'X', i), scene);
    add_trees_behind(sides[i], Draw(courtyard.seed, 'Z', i), scene);
  }
  add_things_between(courtyard, scene);
  return scene;
}

}  // namespace stemvo::synth
