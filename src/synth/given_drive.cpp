// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>

#include "synth/drive.hpp"
#include "synth/revisits.hpp"

namespace stemvo::synth {
namespace {

constexpr double kStraightOn_m = 10.0;  // more road at both ends than is needed
constexpr double kFine_m = 0.25;        // spacing while smoothing

Vec3 forward_of(const Rigid3& pose) { return pose.rotation_matrix().col(2); }
Vec3 up_of(const Rigid3& pose) { return -pose.rotation_matrix().col(1); }

/// The cameras that moved the path on.
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

/// The keys, prolonged straight on both sides.
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

/// Moves each camera up by the lift of the knot that it is at.
void lift(const std::vector<double>& lifts_m, Drive& drive) {
  const std::vector<double> arcs_m = arcs_along(drive.road, drive.world_from_camera);
  for (std::size_t i = 0; i < arcs_m.size(); ++i) {
    drive.world_from_camera[i].translation.y() -= lifts_m[static_cast<std::size_t>(arcs_m[i])];
  }
}

}  // namespace

Drive make_drive_along(const Trajectory& world_from_camera) {
  Drive drive{fit_road(choose_keys(world_from_camera)), world_from_camera, {}};
  std::vector<int> homes = find_revisits(drive.road);
  if (std::ranges::any_of(homes, [](int home) { return home != kNewPlace; })) {
    lift(lifts_to_first_visit(drive.road, homes), drive);
    const RoadCurve level = fit_road(choose_keys(drive.world_from_camera));
    drive.road = joined(level, find_revisits(level));
  }
  drive.arcs_m = arcs_along(drive.road, drive.world_from_camera);
  return drive;
}

}  // namespace stemvo::synth
