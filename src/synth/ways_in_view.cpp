// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <ranges>

#include "synth/drive.hpp"

namespace stemvo::synth {
namespace {

constexpr int kNeighbours = 45;  // knots: nearer ones are the same street

/// Last knot from `start` in direction `step` before the road comes back near the way from `from`,
/// a knot on the other side of `start`.
int last_clear_knot(const RoadCurve& road, int from, int start, int step, double reach_m) {
  constexpr double kClear_m = 2.0 * kStreetHalfWidth_m;
  const int end = start + step * static_cast<int>(reach_m);
  for (int i = start; i != end; i += step) {
    const int next = i + step;
    if (next < 0 || next >= road.num_knots()) {
      return i;
    }
    for (int j = from; (next - j) * step >= kNeighbours; j += step) {
      if ((road.knot(next).position - road.knot(j).position).norm() < kClear_m) {
        return i;
      }
    }
  }
  return end;
}

constexpr double kInView_m = 170.0;

/// Nothing stands in the way of the street the camera is in: the window ends where the road comes
/// back to itself.
cv::Range visible_window(const RoadCurve& road, double arc_m) {
  constexpr double kSeenBack_m = 60.0;
  constexpr int kBeside = 30;  // what is ahead must not stand in the street just behind the camera
  const int here = std::clamp(static_cast<int>(arc_m), 0, road.num_knots() - 1);
  const int last = last_clear_knot(road, std::max(here - kBeside, 0), here, 1, kInView_m);
  return {last_clear_knot(road, last, here, -1, kSeenBack_m), last + 1};
}

}  // namespace

bool RoadCurve::is_in_the_way(int knot, double lateral_m, const Vec3& point) const {
  constexpr int kBefore = 40;   // knots: a house there may reach so far
  constexpr int kBehind = 120;  // by then the roads are apart
  const bool is_beyond_sidewalk = lateral_m < -6.7 || lateral_m > 6.7;
  const double left_m = is_beyond_sidewalk ? -7.2 : -5.1;
  const double right_m = is_beyond_sidewalk ? 6.6 : 2.1;
  return std::ranges::any_of(parts_, [&](const RoadPart& visit) {
    const int earlier = visit.end - visit.shift;
    const bool is_later = knot >= visit.end && knot < visit.end + kBehind;
    const int on_earlier = home(knot) - earlier;
    if (visit.shift == 0 || (!is_later && (on_earlier < -kBefore || on_earlier >= kBehind))) {
      return false;
    }
    const int begin = is_later ? earlier : visit.end;
    const int end = std::min(begin + kBehind, num_knots());
    return std::any_of(knots_.begin() + begin, knots_.begin() + end, [&](const RoadFrame& other) {
      const Vec3 off = point - other.position;
      const double across_m = other.right.dot(off);
      return std::abs(other.forward.dot(off)) < 0.8 && across_m > left_m && across_m < right_m;
    });
  });
}

/// Where the road forks in the window, the way that the camera's does not take is seen, too, until
/// it comes near the window again.
std::vector<cv::Range> ways_in_view(const RoadCurve& road, double arc_m) {
  const cv::Range window = visible_window(road, arc_m);
  std::vector<cv::Range> ways = {window};
  const auto in_window = std::views::iota(window.start, window.end);
  for (const auto& [first, later, shift] : road.parts()) {
    const int earlier = later - shift;
    const bool is_on_later = later >= window.start && later < window.end;
    const auto at = is_on_later ? std::ranges::find(in_window, later)
                                : std::ranges::find(in_window, earlier,
                                                    [&](int knot) { return road.home(knot); });
    if (shift == 0 || at == in_window.end()) {
      continue;
    }
    const int begin = is_on_later ? earlier : later;
    const int seen = static_cast<int>(kInView_m - std::max(0.0, *at - arc_m));
    // A lot of the earlier street lies across the end of the visit.
    cv::Range way(is_on_later ? begin - static_cast<int>(kLot_m) : begin, begin);
    const auto is_near = [&](int knot) {  // not just where the ways part
      return std::abs((knot - *at) - (way.end - begin)) >= kNeighbours &&
             (road.knot(knot).position - road.knot(way.end).position).norm() <
                 2.0 * kStreetHalfWidth_m;
    };
    while (way.end < std::min(begin + seen, road.part_of(begin).end) &&
           std::ranges::none_of(in_window, is_near)) {
      ++way.end;
    }
    ways.push_back(way);
  }
  return ways;
}

}  // namespace stemvo::synth
