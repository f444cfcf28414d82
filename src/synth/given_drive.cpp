// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "synth/drive.hpp"

namespace stemvo::synth {
namespace {

constexpr double kStraightOn_m = 10.0;  // more road at both ends than is needed
constexpr double kFine_m = 0.25;        // spacing while smoothing

Vec3 forward_of(const Rigid3& pose) { return pose.rotation_matrix().col(2); }
Vec3 up_of(const Rigid3& pose) { return -pose.rotation_matrix().col(1); }

Trajectory choose_keys(const Trajectory& poses) {
  constexpr double kMinAdvance_m = 0.3;  // less is standing, turning on the spot, or reversing
  Trajectory keys = {poses.front()};
  for (const Rigid3& pose : poses) {
    const Vec3 step = pose.translation - keys.back().translation;
    if (step.dot(forward_of(pose) + forward_of(keys.back())) > 2.0 * kMinAdvance_m) {
      keys.push_back(pose);
    }
  }
  return keys;
}

/// Mean weighted by a Gaussian along the path.
std::vector<Vec3> smooth(const std::vector<Vec3>& points, double sigma_m) {
  const double sigma = sigma_m / kFine_m;
  const int n = static_cast<int>(points.size());
  const int reach = static_cast<int>(std::ceil(3.0 * sigma));
  std::vector<Vec3> result;
  for (int i = 0; i < n; ++i) {
    // At the ends the window shrinks evenly, so that a straight line stays where it is.
    const int span = std::min({reach, i, n - 1 - i});
    Vec3 sum = Vec3::Zero();
    double total = 0.0;
    for (int k = -span; k <= span; ++k) {
      const double weight = std::exp(-0.5 * k * k / (sigma * sigma));
      sum += weight * points[static_cast<std::size_t>(i + k)];
      total += weight;
    }
    result.emplace_back(sum / total);
  }
  return result;
}

Path resample(const Path& from, double spacing_m) {
  Path to;
  double left_m = 0.0;  // from the last sample to the start of this edge, as a debt
  for (std::size_t i = 0; i + 1 < from.points.size(); ++i) {
    const Vec3 edge = from.points[i + 1] - from.points[i];
    const double length_m = edge.norm();
    for (; left_m < length_m; left_m += spacing_m) {
      const double t = left_m / length_m;
      to.add(from.points[i] + t * edge,
             ((1.0 - t) * from.ups[i] + t * from.ups[i + 1]).normalized());
    }
    left_m -= length_m;
  }
  return to;
}

Path prolong(const Trajectory& keys) {
  const std::size_t last = keys.size() - 1;
  const std::size_t reach = std::min<std::size_t>(4, last);
  const auto direction = [&](std::size_t from, std::size_t to, const Rigid3& end) -> Vec3 {
    const Vec3 along = keys[to].translation - keys[from].translation;
    return along.norm() > 1.0 ? along.normalized() : forward_of(end);
  };
  const Rigid3& first = keys.front();
  const Rigid3& end = keys.back();
  Path path;
  path.add(first.translation - (kRoadBehind_m + kStraightOn_m) * direction(0, reach, first),
           up_of(first));
  for (const Rigid3& key : keys) {
    path.add(key.translation, up_of(key));
  }
  path.add(end.translation + (kRoadAhead_m + kStraightOn_m) * direction(last - reach, last, end),
           up_of(end));
  return path;
}

/// The path is followed closely to the sides (2 m), loosely in height (7 m) and bank (10 m): that
/// is what is left of bounce, pitch and roll once the road is taken away.
RoadCurve fit_road(const Trajectory& keys) {
  const Path fine = resample(prolong(keys), kFine_m);
  const std::vector<Vec3> ups = smooth(fine.ups, 10.0);
  const std::vector<Vec3> close = smooth(fine.points, 2.0);
  const std::vector<Vec3> loose = smooth(fine.points, 7.0);
  Path ground;
  for (std::size_t i = 0; i < ups.size(); ++i) {
    const Vec3 up = ups[i].normalized();
    const double height_m = up.dot(loose[i] - close[i]) - kCameraHeight_m;
    ground.add(close[i] + height_m * up, up);
  }
  return RoadCurve(resample(ground, 1.0));
}

/// Per camera the arc length of the nearest knot, of those near the last camera's.
std::vector<double> arcs_along(const RoadCurve& road, const Trajectory& world_from_camera) {
  constexpr int kReach = 24;  // knots; a car moves less between two frames
  std::vector<double> arcs_m;
  int last = static_cast<int>(kRoadBehind_m + kStraightOn_m);
  for (const Rigid3& pose : world_from_camera) {
    const auto distance2 = [&](int i) {
      return (road.knot(i).position - pose.translation).squaredNorm();
    };
    int best = last;
    const int end = std::min(last + kReach + 1, road.num_knots());
    for (int i = std::max(last - kReach, 0); i < end; ++i) {
      best = distance2(i) < distance2(best) ? i : best;
    }
    last = best;
    arcs_m.push_back(best);
  }
  return arcs_m;
}

void lift(const std::vector<double>& lifts_m, Drive& drive) {
  const std::vector<double> arcs_m = arcs_along(drive.road, drive.world_from_camera);
  for (std::size_t i = 0; i < arcs_m.size(); ++i) {
    drive.world_from_camera[i].translation.y() -= lifts_m[static_cast<std::size_t>(arcs_m[i])];
  }
}

constexpr int kNewPlace = -1;
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
    double length_m = 0.0;
    for (std::size_t i = 1; i < line.points.size(); ++i) {
      length_m += (line.points[i] - line.points[i - 1]).norm();
    }
    const int count = std::max(1, static_cast<int>(std::lround(length_m)));
    const Path even = resample(line, length_m / count);
    for (std::size_t i = 1; i < static_cast<std::size_t>(count); ++i) {  // between both ends
      path_.add(even.points[i], even.ups[i]);
    }
  }

  const RoadCurve& road_;
  const std::vector<int>& homes_;
  std::vector<int> joined_;  ///< per own knot on a new place: its number on the joined road
  Path path_;
  std::vector<RoadPart> parts_;
};

/// Per knot of a road: the knot of an earlier part of the road on which it comes back, in the same
/// direction; or kNewPlace. Earlier parts are new places themselves.
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

/// Metres per knot, upwards, that bring each street's second visit to the height of its first.
/// Between visits they change evenly along the road.
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

}  // namespace

Drive make_drive_along(const Trajectory& world_from_camera) {
  Drive drive{fit_road(choose_keys(world_from_camera)), world_from_camera, {}};
  std::vector<int> homes = find_revisits(drive.road);
  if (std::ranges::any_of(homes, [](int home) { return home != kNewPlace; })) {
    lift(lifts_to_first_visit(drive.road, homes), drive);
    const RoadCurve level = fit_road(choose_keys(drive.world_from_camera));
    drive.road = Joiner(level, find_revisits(level)).join();
  }
  drive.arcs_m = arcs_along(drive.road, drive.world_from_camera);
  return drive;
}

}  // namespace stemvo::synth
