// SPDX-License-Identifier: MIT
#include "synth/revisits.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace stemvo::synth {
namespace {

constexpr int kBlend = 12;  ///< knots on which a road joins its earlier part, or leaves it

/// The earlier knot nearest to knot `at` on a new place, of those that are level with it.
int nearest_home(const RoadCurve& road, int at, const std::vector<int>& homes) {
  constexpr int kApart = 100;  // knots: nearer ones are the same visit
  constexpr double kSameStreet_m = 5.0;
  constexpr double kLevel_m = 6.0;  // a bridge is higher; measured heights drift by 4 m
  const double min_cosine = std::cos(radians(30.0));
  const RoadFrame& here = road.knot(at);
  double nearest_m = kSameStreet_m;
  int home = kNewPlace;
  for (int j = 0; j <= at - kApart;) {
    const Vec3 offset = road.knot(j).position - here.position;
    const double distance_m = std::hypot(offset.x(), offset.z());
    if (homes[static_cast<std::size_t>(j)] == kNewPlace && distance_m < nearest_m &&
        std::abs(offset.y()) < kLevel_m && road.knot(j).forward.dot(here.forward) > min_cosine) {
      nearest_m = distance_m;
      home = j;
    }
    // Knots are 1 m apart, so those between are too far away.
    j += std::max(1, static_cast<int>(distance_m - kSameStreet_m));
  }
  return home;
}

/// Moved sideways and up on to the line of an earlier knot.
Vec3 on_line(const RoadFrame& home, const Vec3& point) {
  return home.position + home.forward.dot(point - home.position) * home.forward;
}

/// Builds the joined road knot by knot.
class Joiner {
 public:
  Joiner(const RoadCurve& road, const std::vector<int>& homes)
      : road_(road), homes_(homes), joined_(homes.size(), kNewPlace) {}

  RoadCurve join() {
    const int end = road_.num_knots();
    for (int i = 0; i < end;) {
      if (homes_[static_cast<std::size_t>(i)] == kNewPlace) {
        joined_[static_cast<std::size_t>(i)] = static_cast<int>(path_.points.size());
        path_.add(road_.knot(i).position, road_.knot(i).up);
        ++i;
        continue;
      }
      int run_end = i;
      while (run_end < end && homes_[static_cast<std::size_t>(run_end)] != kNewPlace) {
        ++run_end;
      }
      add_visit(i, run_end);
      i = run_end;
    }
    close_part(0);
    return RoadCurve(path_, parts_);
  }

 private:
  /// The knots since the last part are a part that is `shift` knots behind its first visit.
  void close_part(int shift) {
    const int begin = parts_.empty() ? 0 : parts_.back().end;
    const int end = static_cast<int>(path_.points.size());
    if (end > begin) {
      parts_.push_back({begin, end, shift});
    }
  }

  /// Own knots [begin, end) are on an earlier part.
  void add_visit(int begin, int end) {
    const int first = homes_[static_cast<std::size_t>(begin + kBlend)];
    const int last = homes_[static_cast<std::size_t>(end - 1 - kBlend)];
    add_blend(begin, begin + kBlend, true);
    close_part(0);
    const int shift =
        static_cast<int>(path_.points.size()) - joined_[static_cast<std::size_t>(first)];
    for (int home = first; home <= last; ++home) {
      path_.add(road_.knot(home).position, road_.knot(home).up);
    }
    close_part(shift);
    add_blend(end - kBlend, end, false);
  }

  /// Own knots [begin, end), each a little more on the earlier part than the one before, or less;
  /// laid anew between the knots before and behind them, evenly and about 1 m apart.
  void add_blend(int begin, int end, bool is_joining) {
    const auto knot_at = [&](int own, bool is_home) -> const RoadFrame& {
      return road_.knot(is_home ? homes_[static_cast<std::size_t>(own)] : own);
    };
    const RoadFrame& from = knot_at(begin - 1, !is_joining);
    Path line{{from.position}, {from.up}};
    for (int own = begin; own < end; ++own) {
      const double t = (own - begin + 1.0) / (end - begin + 1.0);
      const double share = is_joining ? t : 1.0 - t;
      const double weight = share * share * (3.0 - 2.0 * share);
      const RoadFrame& home = knot_at(own, true);
      const RoadFrame& here = road_.knot(own);
      line.add(here.position + weight * (on_line(home, here.position) - here.position),
               ((1.0 - weight) * here.up + weight * home.up).normalized());
    }
    const RoadFrame& to = knot_at(end, is_joining);
    line.add(to.position, to.up);
    add_evenly(line);
  }

  /// Points between both ends of a line.
  void add_evenly(const Path& blend) {
    const auto& [line, ups] = blend;
    double length_m = 0.0;
    for (std::size_t i = 1; i < line.size(); ++i) {
      length_m += (line[i] - line[i - 1]).norm();
    }
    const int count = std::max(1, static_cast<int>(std::lround(length_m)));
    double passed_m = 0.0;  // until the edge
    std::size_t edge = 1;
    for (int i = 1; i < count; ++i) {
      const double at_m = length_m * i / count;
      double edge_m = (line[edge] - line[edge - 1]).norm();
      while (passed_m + edge_m < at_m && edge + 1 < line.size()) {
        passed_m += edge_m;
        ++edge;
        edge_m = (line[edge] - line[edge - 1]).norm();
      }
      const double t = std::clamp((at_m - passed_m) / std::max(edge_m, 1e-9), 0.0, 1.0);
      path_.add(line[edge - 1] + t * (line[edge] - line[edge - 1]),
                ((1.0 - t) * ups[edge - 1] + t * ups[edge]).normalized());
    }
  }

  const RoadCurve& road_;
  const std::vector<int>& homes_;
  std::vector<int> joined_;  ///< per own knot on a new place: its number on the joined road
  Path path_;
  std::vector<RoadPart> parts_;
};

}  // namespace

std::vector<int> find_revisits(const RoadCurve& road) {
  constexpr int kShortest = 2 * kBlend + 20;  // knots
  constexpr int kMaxStep = 4;                 // of the earlier knots, between neighbours
  std::vector<int> homes(static_cast<std::size_t>(road.num_knots()), kNewPlace);
  const auto home = [&](int i) -> int& { return homes[static_cast<std::size_t>(i)]; };
  int begin = 0;  // of the present visit
  for (int i = 0; i <= road.num_knots(); ++i) {
    int found = kNewPlace;
    // The road's ends stay what they are: knots before and behind a visit are needed.
    if (i > 0 && i + 1 < road.num_knots()) {
      found = nearest_home(road, i, homes);
    }
    if (found != kNewPlace && i > begin) {
      const int step = found - home(i - 1);
      found = step >= 0 && step <= kMaxStep ? found : kNewPlace;
    }
    if (found != kNewPlace) {
      home(i) = found;
      continue;
    }
    if (i - begin < kShortest) {
      std::fill(homes.begin() + begin, homes.begin() + std::min(i, road.num_knots()), kNewPlace);
    }
    begin = i + 1;
  }
  return homes;
}

std::vector<double> lifts_to_first_visit(const RoadCurve& road, const std::vector<int>& homes) {
  constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  std::vector<double> lifts(homes.size(), kUnknown);
  for (std::size_t i = 0; i < homes.size(); ++i) {
    if (homes[i] != kNewPlace) {
      const RoadFrame& first = road.knot(homes[i]);
      const Vec3 offset = first.position - road.knot(static_cast<int>(i)).position;
      lifts[i] = first.up.dot(offset) / -first.up.y();
      lifts[static_cast<std::size_t>(homes[i])] = 0.0;
    }
  }
  std::optional<std::size_t> last;  // with a known lift
  for (std::size_t i = 0; i < lifts.size(); ++i) {
    if (std::isnan(lifts[i])) {
      continue;
    }
    for (std::size_t k = last ? *last + 1 : 0; k < i; ++k) {
      const double t = last ? static_cast<double>(k - *last) / static_cast<double>(i - *last) : 1.0;
      const double from = last ? lifts[*last] : lifts[i];
      lifts[k] = from + t * (lifts[i] - from);
    }
    last = i;
  }
  std::fill(lifts.begin() + (last ? static_cast<std::ptrdiff_t>(*last) : 0), lifts.end(),
            last ? lifts[*last] : 0.0);
  return lifts;
}

RoadCurve joined(const RoadCurve& road, const std::vector<int>& homes) {
  return Joiner(road, homes).join();
}

}  // namespace stemvo::synth
