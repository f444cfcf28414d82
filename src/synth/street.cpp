// SPDX-License-Identifier: MIT
#include <algorithm>
#include <functional>
#include <optional>

#include "synth/drive.hpp"
#include "synth/materials.hpp"
#include "synth/objects.hpp"

namespace stemvo::synth {
namespace {

struct Street {
  const RoadCurve& road;
  double camera_m;   ///< arc length
  cv::Range window;  ///< knots of the road that are drawn
  std::uint64_t seed;
  const std::vector<int>& crossings;  ///< knots of a first visit, in the middle of crossing roads
  Scene& scene;

  /// Calls build(slot, arc_m) for every slot of `length_m` inside the window and inside one part of
  /// the road. Slots are numbered along the whole road, by its first visit to a place, so that a
  /// thing is the same from wherever and whenever it is seen.
  template <typename Build>
  void for_each_slot(double length_m, const Build& build) const {
    for (const auto& [begin, end, shift] : road.parts()) {
      const int first = std::max(begin, window.start) - shift;
      const int last = std::min(end, window.end) - shift - 1;
      for (int slot = static_cast<int>(std::ceil(first / length_m));
           slot * length_m + length_m <= last; ++slot) {
        if (!is_crossed(slot * length_m, slot * length_m + length_m)) {
          build(slot, slot * length_m + shift);
        }
      }
    }
  }
  /// Whether a road crosses between these arc lengths of the first visit.
  [[nodiscard]] bool is_crossed(double begin_m, double end_m) const {
    return std::ranges::any_of(crossings, [&](int middle) {
      return begin_m < middle + kCrossingHalf_m && end_m > middle - kCrossingHalf_m;
    });
  }
  [[nodiscard]] bool is_crossed(int knot) const {
    return is_crossed(road.home(knot), road.home(knot) + 1);
  }
  /// Coordinates of the road's texture, near 0 around the camera.
  [[nodiscard]] double u_m(int knot) const {
    const auto& [begin, end, shift] = road.part_of(knot);
    const double near_m =
        std::clamp(camera_m, static_cast<double>(begin), static_cast<double>(end)) - shift;
    return knot - shift - std::floor(near_m / kTexturePeriod_m) * kTexturePeriod_m;
  }
  /// The same on the left (-1) and on the right (1): build(draw, side, arc_m).
  template <typename Build>
  void for_each_lot(char key, double length_m, const Build& build) const {
    for (const double side : {-1.0, 1.0}) {
      for_each_slot(length_m, [&](int slot, double arc_m) {
        build(Draw(seed, key, side > 0.0, slot), side, arc_m);
      });
    }
  }
  /// The road at `arc_m`; nullopt: a tight turn leaves the street less than that share of its
  /// width, or a road goes there at a fork.
  [[nodiscard]] std::optional<RoadFrame> roomy(double arc_m,
                                               double lateral_m,
                                               double share = 0.75) const {
    const RoadFrame frame = road.at(arc_m);
    return frame.squeeze(lateral_m) < share ||
                   road.is_in_the_way(static_cast<int>(arc_m), lateral_m,
                                      frame.point(lateral_m, 0.0))
               ? std::nullopt
               : std::optional(frame);
  }
};

struct Corner {
  int knot;  ///< 0 or 1
  double lateral_m;
  double height_m;
};

void add_segment(const Street& street,
                 int knot,
                 const std::array<Corner, 4>& corners,
                 const Style& style) {
  const bool is_upright = corners[0].lateral_m == corners[2].lateral_m;
  std::array<Vec3, 4> points;
  std::array<Vec2, 4> texture;
  for (std::size_t k = 0; k < 4; ++k) {
    const auto& [end, lateral_m, height_m] = corners[k];
    points[k] = street.road.knot(knot + end).point(lateral_m, height_m);
    const double u = street.u_m(knot);
    texture[k] = {u + end, is_upright ? height_m : lateral_m};
  }
  street.scene.add_patch(points, texture, style);
}

/// Strips between lines along the road; lateral distances to the right of the camera's path, which
/// runs in the right lane. A road that crosses is level.
void add_ground(const Street& street) {
  struct Line {
    double lateral_m;
    double height_m;
    Material material;  ///< of the strip to its right
    Rgb albedo;
  };
  const Rgb kStone = {0.46F, 0.445F, 0.42F};
  const Rgb kPaving = {0.43F, 0.41F, 0.39F};
  const Rgb kGreen = {0.24F, 0.32F, 0.13F};
  constexpr double kKerb_m = 0.12;
  const std::array<Line, 10> kLines = {{{-kStreetHalfWidth_m, 0.25, materials::grass, kGreen},
                                        {-7.2, kKerb_m, materials::sidewalk, kPaving},
                                        {-5.35, kKerb_m, materials::kerb, kStone},
                                        {-5.2, kKerb_m, materials::kerb, kStone},
                                        {-5.2, 0.0, materials::asphalt, kAsphalt},
                                        {2.2, 0.0, materials::parking, {0.38F, 0.365F, 0.355F}},
                                        {4.4, 0.0, materials::kerb, kStone},
                                        {4.4, kKerb_m, materials::sidewalk, kPaving},
                                        {6.6, kKerb_m, materials::grass, kGreen},
                                        {kStreetHalfWidth_m, 0.25, nullptr, {}}}};
  for (auto left = kLines.begin(); left + 1 != kLines.end(); ++left) {
    const auto right = left + 1;
    for (int i = street.window.start; i + 1 < street.window.end; ++i) {
      const bool is_crossed = street.is_crossed(i);
      const double middle_m = 0.5 * (left->lateral_m + right->lateral_m);
      if ((is_crossed && left->lateral_m == right->lateral_m) ||
          (left->material != materials::asphalt &&
           street.road.is_in_the_way(i, 0.0, street.road.knot(i).point(middle_m, 0.0)))) {
        continue;
      }
      const Style style{.material = is_crossed ? materials::asphalt : left->material,
                        .seed = static_cast<std::uint32_t>(hash_of(street.seed, 'G')),
                        .albedo = is_crossed ? kAsphalt : left->albedo};
      const double low_m = is_crossed ? 0.0 : left->height_m;
      const double high_m = is_crossed ? 0.0 : right->height_m;
      add_segment(street, i,
                  {{{0, left->lateral_m, low_m},
                    {0, right->lateral_m, high_m},
                    {1, right->lateral_m, high_m},
                    {1, left->lateral_m, low_m}}},
                  style);
      for (const int end : {0, 1}) {  // the strip's end at a crossing road
        if (low_m > 0.0 && street.is_crossed(end == 0 ? i - 1 : i + 1)) {
          add_segment(street, i,
                      {{{end, left->lateral_m, 0.0},
                        {end, right->lateral_m, 0.0},
                        {end, right->lateral_m, right->height_m},
                        {end, left->lateral_m, left->height_m}}},
                      {.albedo = kStone});
        }
      }
    }
  }
}

/// Hedge, garden wall or fence at the outer edges, a new kind every 16 m or so.
void add_borders(const Street& street) {
  const Style kHedge{.material = materials::hedge, .albedo = {0.15F, 0.22F, 0.09F}};
  const Style kWall{.material = materials::plain_wall, .albedo = {0.55F, 0.52F, 0.48F}};
  const Style kFence{.material = materials::fence, .albedo = {0.33F, 0.25F, 0.17F}};
  for (const double side : {-1.0, 1.0}) {
    const double lateral_m = side * kStreetHalfWidth_m;
    for (int i = street.window.start; i + 1 < street.window.end; ++i) {
      const Vec3 middle = street.road.at(i + 0.5).point(lateral_m, 0.0);
      if (street.is_crossed(i) || street.road.is_in_the_way(i, lateral_m, middle)) {
        continue;
      }
      Draw draw(street.seed, 'B', side > 0.0, street.road.home(i) / 16);
      const std::uint32_t seed = draw.bits();
      const double share = draw.next();
      Style style = share < 0.6 ? kHedge : share < 0.8 ? kWall : kFence;
      style.seed = seed;
      const double height_m = draw.in(1.9, 3.2) * (share < 0.6 ? 1.0 : share < 0.8 ? 0.8 : 0.75);
      add_segment(street, i,
                  {{{0, lateral_m, 0.0},
                    {1, lateral_m, 0.0},
                    {1, lateral_m, height_m},
                    {0, lateral_m, height_m}}},
                  style);
    }
  }
}

const std::array<Rgb, 8> kPlaster = {{{0.78F, 0.76F, 0.70F},
                                      {0.72F, 0.64F, 0.48F},
                                      {0.62F, 0.60F, 0.57F},
                                      {0.66F, 0.52F, 0.42F},
                                      {0.50F, 0.33F, 0.26F},
                                      {0.80F, 0.74F, 0.58F},
                                      {0.56F, 0.60F, 0.63F},
                                      {0.44F, 0.42F, 0.40F}}};

void add_building(const Street& street, Draw draw, double side, double arc_m) {
  if (!draw.chance(0.72)) {
    return;  // a garden
  }
  const double begin_m = arc_m + draw.in(0.2, 2.5);
  const double end_m = arc_m + kLot_m - draw.in(0.2, 3.5);
  const RoadFrame a = street.road.at(begin_m);
  const RoadFrame b = street.road.at(end_m);
  const double front_m = side * draw.in(7.6, 10.4);
  const double back_m = side * (kStreetHalfWidth_m + 1.0);
  House house{
      {a.point(front_m, 0.0), b.point(front_m, 0.0), b.point(back_m, 0.0), a.point(back_m, 0.0)},
      street.road.at(0.5 * (begin_m + end_m)).up,
      {.material = materials::facade},
      street.scene};
  for (int i = 0; i <= 8; ++i) {
    const RoadFrame along = street.road.at(begin_m + i * (end_m - begin_m) / 8.0);
    for (const double across_m : {front_m, back_m}) {
      if (street.road.is_in_the_way(static_cast<int>(arc_m), across_m,
                                    along.point(across_m, 0.0))) {
        return;
      }
    }
  }
  // A house does not lean with the street.
  const double level = house.up.dot(house.plan[0] + house.plan[1]) / 2.0;
  for (Vec3& corner : house.plan) {
    corner += (level - house.up.dot(corner)) * house.up;
  }
  const int floors = 1 + static_cast<int>(draw.in(1.0, 3.6));
  const double eaves_m = 0.6 + 2.9 * floors;
  house.style.seed = draw.bits();
  house.style.albedo = kPlaster[draw.bits() % kPlaster.size()];
  house.style.albedo = house.style.albedo * draw.in_float(0.85, 1.2);
  const std::uint32_t roof_seed = draw.bits();
  house.add(eaves_m, draw.in(1.6, 3.2), roof_seed);
}

void add_tree(const Street& street, double arc_m, double lateral_m, double size, Draw draw) {
  const auto place = street.roomy(arc_m, lateral_m);
  if (!place) {
    return;
  }
  const Style bark{
      .material = materials::bark, .seed = draw.bits(), .albedo = {0.20F, 0.16F, 0.12F}};
  const Vec3 foot = place->point(lateral_m, -0.1);
  const double trunk_m = size * draw.in(1.8, 2.6);
  const double radius_m = size * draw.in(1.0, 1.6);
  const double stretch = draw.in(0.9, 1.5);
  street.scene.add_prism(foot, size * draw.in(0.08, 0.16), trunk_m + 0.6 * radius_m, bark);
  add_crown(foot - (trunk_m + 0.8 * radius_m * stretch) * Vec3::UnitY(), radius_m, stretch, draw,
            street.scene);
}

/// Trees along the sidewalk and in the gardens, bushes before house and hedge.
void add_plants(const Street& street) {
  street.for_each_lot('T', 11.0, [&](Draw draw, double side, double arc_m) {
    if (draw.chance(0.38)) {
      const double lateral_m = side * draw.in(6.9, 7.3);
      const double tree_m = arc_m + draw.in(1.0, 10.0);
      add_tree(street, tree_m, lateral_m, 1.0, draw);
    }
  });
  street.for_each_lot('D', 7.0, [&](Draw draw, double side, double arc_m) {
    if (draw.chance(0.75)) {
      const double size = draw.in(1.1, 2.2);
      const double lateral_m = side * draw.in(11.0, 14.0);
      const double tree_m = arc_m + draw.in(0.5, 6.5);
      add_tree(street, tree_m, lateral_m, size, draw);
    }
  });
  street.for_each_lot('b', 2.4, [&](Draw draw, double side, double arc_m) {
    const double bush_m = arc_m + draw.in(0.0, 2.4);
    const double lateral_m = side * (draw.chance(0.6) ? draw.in(7.3, 7.8) : draw.in(9.0, 12.5));
    const auto place = street.roomy(bush_m, lateral_m);
    if (draw.chance(0.5) && place) {
      const double radius_m = draw.in(0.25, 0.6);
      const double stretch = draw.in(0.9, 1.6);
      add_crown(place->point(lateral_m, 0.7 * radius_m), radius_m, stretch, draw, street.scene);
    }
  });
}

void add_poles(const Street& street) {
  street.for_each_slot(14.0, [&](int slot, double arc_m) {
    Draw draw(street.seed, 'P', slot);
    const bool is_lamp = draw.chance(0.5);
    const double lateral_m = draw.chance(0.5) ? 4.75 : -5.6;
    const auto place = street.roomy(arc_m + draw.in(1.0, 13.0), lateral_m);
    if (!place || draw.chance(0.25)) {
      return;
    }
    const Vec3 up = -Vec3::UnitY();
    const Vec3 foot = place->point(lateral_m, 0.0);
    if (is_lamp) {
      constexpr double kHeight_m = 6.5;
      const Style style{.albedo = {0.28F, 0.31F, 0.30F}};
      const Vec3 arm = (lateral_m > 0.0 ? -1.2 : 1.2) * place->right;
      street.scene.add_prism(foot, 0.075, kHeight_m, style);
      street.scene.add_box(foot + kHeight_m * up, {arm, 0.12 * place->forward, 0.1 * up}, style);
    } else {
      const double kind = draw.next();
      const Style sign{.albedo = kind < 0.4   ? Rgb{0.75F, 0.75F, 0.72F}
                                 : kind < 0.7 ? Rgb{0.15F, 0.25F, 0.6F}
                                              : Rgb{0.7F, 0.62F, 0.2F}};
      street.scene.add_prism(foot, 0.035, 2.6, {.albedo = {0.5F, 0.5F, 0.5F}});
      street.scene.add_box(foot + 1.95 * up - 0.3 * place->right - 0.06 * place->forward,
                           {0.6 * place->right, 0.03 * place->forward, 0.6 * up}, sign);
    }
  });
}

}  // namespace

void add_street(const RoadCurve& road,
                double arc_m,
                std::uint64_t seed,
                Scene& scene,
                const std::vector<int>& crossings) {
  for (const cv::Range& way : ways_in_view(road, arc_m)) {
    const Street street{road, arc_m, way, seed, crossings, scene};
    add_ground(street);
    add_borders(street);
    street.for_each_lot('H', kLot_m, std::bind_front(add_building, std::cref(street)));
    add_plants(street);
    add_poles(street);
    street.for_each_slot(6.5, [&](int slot, double slot_m) {
      constexpr double kParked_m = 3.35;  // at the kerb on the right
      Draw draw(street.seed, 'C', slot);
      auto place = street.roomy(slot_m + draw.in(0.5, 1.4), kParked_m, 0.95);
      if (place && draw.chance(0.3)) {
        place->position = place->point(kParked_m, 0.0);
        add_car(*place, draw, false, street.scene, true);
      }
    });
    for (int i = street.window.start; i < street.window.end; ++i) {
      if (std::ranges::find(crossings, road.home(i)) != crossings.end()) {
        add_side_streets(road.knot(i), hash_of(seed, 'Q', road.home(i)), scene);
      }
    }
  }
}

}  // namespace stemvo::synth
