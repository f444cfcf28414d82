// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <optional>
#include <ranges>

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
  return weighted_means(points, static_cast<int>(std::ceil(3.0 * sigma)),
                        [&](int k) { return std::exp(-0.5 * k * k / (sigma * sigma)); });
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
    const auto near =
        std::views::iota(std::max(last - kReach, 0), std::min(last + kReach + 1, road.num_knots()));
    last = *std::ranges::min_element(
        near, {}, [&](int i) { return (road.knot(i).position - pose.translation).squaredNorm(); });
    arcs_m.push_back(last);
  }
  return arcs_m;
}

/// Per knot of a road on which it comes back to an earlier part, in the same direction: the knot
/// there. Earlier parts are new places themselves.
using Homes = std::map<int, int>;

constexpr int kBlend = 12;  ///< knots on which a road joins its earlier part, or leaves it

/// The earlier knot nearest to knot `at` on a new place, of those that are level with it.
std::optional<int> nearest_home(const RoadCurve& road, int at, const Homes& homes) {
  constexpr int kApart = 100;  // knots: nearer ones are the same visit
  constexpr double kSameStreet_m = 5.0;
  constexpr double kLevel_m = 6.0;  // a bridge is higher; measured heights drift by 4 m
  const double min_cosine = std::cos(radians(30.0));
  const RoadFrame& here = road.knot(at);
  double nearest_m = kSameStreet_m;
  std::optional<int> home;
  for (int j = 0; j <= at - kApart; ++j) {
    const Vec3 offset = road.knot(j).position - here.position;
    const double distance_m = std::hypot(offset.x(), offset.z());
    if (distance_m < nearest_m && std::abs(offset.y()) < kLevel_m &&
        road.knot(j).forward.dot(here.forward) > min_cosine && !homes.contains(j)) {
      nearest_m = distance_m;
      home = j;
    }
  }
  return home;
}

class Joiner {
 public:
  Joiner(const RoadCurve& road, const Homes& homes) : road_(road), homes_(homes) {}

  RoadCurve join() {
    for (int i = 0; i < road_.num_knots(); ++i) {
      const int begin = i;
      while (homes_.contains(i)) {
        ++i;
      }
      if (i > begin) {
        add_visit(begin, i);
      }
      joined_[i] = static_cast<int>(path_.points.size());
      path_.add(road_.knot(i).position, road_.knot(i).up);
    }
    close_part(0);
    return RoadCurve(path_, parts_);
  }

 private:
  /// The knots since the last part are a part that is `shift` knots behind its first visit.
  void close_part(int shift) {
    const int begin = parts_.empty() ? 0 : parts_.back().end;
    parts_.push_back({begin, static_cast<int>(path_.points.size()), shift});
  }

  /// Own knots [begin, end) are on an earlier part.
  void add_visit(int begin, int end) {
    const int first = homes_.at(begin + kBlend);
    const int last = homes_.at(end - 1 - kBlend);
    add_blend(begin, begin + kBlend, true);
    close_part(0);
    const int shift = static_cast<int>(path_.points.size()) - joined_.at(first);
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
      return road_.knot(is_home ? homes_.at(own) : own);
    };
    const RoadFrame& from = knot_at(begin - 1, !is_joining);
    Path line{{from.position}, {from.up}};
    for (int own = begin; own < end; ++own) {
      const double t = (own - begin + 1.0) / (end - begin + 1.0);
      const double share = is_joining ? t : 1.0 - t;
      const double weight = share * share * (3.0 - 2.0 * share);
      const RoadFrame& home = knot_at(own, true);
      const RoadFrame& here = road_.knot(own);
      const Vec3 off = here.position - home.position;
      const Vec3 on_line = home.position + home.forward.dot(off) * home.forward;
      line.add(here.position + weight * (on_line - here.position),
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
  const Homes& homes_;
  std::map<int, int> joined_;  ///< per own knot on a new place: its number on the joined road
  Path path_;
  std::vector<RoadPart> parts_;
};

Homes find_revisits(const RoadCurve& road) {
  constexpr int kShortest = 2 * kBlend + 20;  // knots
  constexpr int kMaxStep = 4;                 // of the earlier knots, between neighbours
  Homes homes;
  int begin = 1;  // of the present visit
  // The road's ends stay what they are: knots before and behind a visit are needed.
  for (int i = begin; i < road.num_knots(); ++i) {
    const auto found = i + 1 < road.num_knots() ? nearest_home(road, i, homes) : std::nullopt;
    const int step = found && i > begin ? *found - homes.at(i - 1) : 0;
    if (found && step >= 0 && step <= kMaxStep) {
      homes[i] = *found;
      continue;
    }
    if (i - begin < kShortest) {
      homes.erase(homes.lower_bound(begin), homes.end());
    }
    begin = i + 1;
  }
  return homes;
}

/// Brings each street's second visit to the height of its first. Between visits the lift changes
/// evenly along the road.
void lift_to_first_visit(const Homes& homes, Drive& drive) {
  std::map<int, double> lifts_m;  // of knots, upwards
  for (const auto& [knot, home] : homes) {
    const RoadFrame& first = drive.road.knot(home);
    const Vec3 offset = first.position - drive.road.knot(knot).position;
    lifts_m[knot] = first.up.dot(offset) / -first.up.y();
    lifts_m[home] = 0.0;
  }
  const std::vector<double> arcs_m = arcs_along(drive.road, drive.world_from_camera);
  for (std::size_t i = 0; i < arcs_m.size(); ++i) {
    const auto next = lifts_m.upper_bound(static_cast<int>(arcs_m[i]));
    const auto& [end, end_m] = *(next == lifts_m.end() ? std::prev(next) : next);
    const auto& [begin, begin_m] = *(next == lifts_m.begin() ? next : std::prev(next));
    const double t = begin < end ? (arcs_m[i] - begin) / (end - begin) : 0.0;
    drive.world_from_camera[i].translation.y() -= begin_m + t * (end_m - begin_m);
  }
}

}  // namespace

Drive make_drive_along(const Trajectory& world_from_camera) {
  Drive drive{fit_road(choose_keys(world_from_camera)), world_from_camera, {}};
  const Homes homes = find_revisits(drive.road);
  if (!homes.empty()) {
    lift_to_first_visit(homes, drive);
    const RoadCurve level = fit_road(choose_keys(drive.world_from_camera));
    drive.road = Joiner(level, find_revisits(level)).join();
  }
  drive.arcs_m = arcs_along(drive.road, drive.world_from_camera);
  return drive;
}

}  // namespace stemvo::synth
