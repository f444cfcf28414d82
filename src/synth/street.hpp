// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>

#include "synth/drive.hpp"
#include "synth/scene.hpp"

namespace stemvo::synth {

/// Part of a road that is drawn: knots [begin, end).
struct RoadWindow {
  int begin = 0;
  int end = 0;
};

/// 60 m behind and 170 m ahead of `arc_m`, less where the road comes back to itself: what would
/// stand in the way of the street the camera is in is not there.
[[nodiscard]] RoadWindow visible_window(const RoadCurve& road, double arc_m);

/// Things stand only where a tight turn leaves the street that share of its width.
inline constexpr double kRoomy = 0.75;

/// All that a builder of things along the road needs.
struct Street {
  const RoadCurve& road;
  RoadWindow window;
  double texture_origin_m;  ///< arc length where u = 0
  std::uint64_t seed;
  Scene& scene;

  /// Calls build(slot, arc_m) for every slot of `length_m` inside the window; slots are numbered
  /// along the whole road, so that a thing is the same from wherever it is seen.
  template <typename Build>
  void for_each_slot(double length_m, const Build& build) const {
    const double begin_m = window.begin * kKnotSpacing_m;
    const double end_m = (window.end - 1) * kKnotSpacing_m;
    for (int slot = static_cast<int>(begin_m / length_m); slot * length_m <= end_m; ++slot) {
      if (slot * length_m >= begin_m && slot * length_m + length_m <= end_m) {
        build(slot, slot * length_m);
      }
    }
  }
  /// The same on the left (-1) or on the right (1): build(draw, arc_m).
  template <typename Build>
  void for_each_lot(char key, double side, double length_m, const Build& build) const {
    for_each_slot(length_m,
                  [&](int slot, double arc_m) { build(Draw(seed, key, side > 0.0, slot), arc_m); });
  }
};

void add_plants(const Street& street);

/// The whole street near `arc_m`, seen from `camera_position`.
[[nodiscard]] Scene build_street(const RoadCurve& road,
                                 double arc_m,
                                 const Vec3& camera_position,
                                 const Vec3& to_sun,
                                 std::uint64_t seed);

}  // namespace stemvo::synth
