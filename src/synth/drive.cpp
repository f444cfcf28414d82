// SPDX-License-Identifier: MIT
#include "synth/drive.hpp"

#include <algorithm>
#include <numeric>

namespace stemvo::synth {
namespace {

/// Smallest value within `reach` knots, then the mean over the same reach: smooth and never above
/// the input, because every value in the mean already is a minimum over a window with this knot.
std::vector<double> smooth_lower_bound(const std::vector<double>& values, std::ptrdiff_t reach) {
  std::vector<double> lowest;
  std::vector<double> result;
  const auto n = std::ssize(values);
  for (std::ptrdiff_t i = 0; i < n; ++i) {
    lowest.push_back(*std::min_element(values.begin() + std::max(i - reach, 0L),
                                       values.begin() + std::min(i + reach + 1, n)));
  }
  for (std::ptrdiff_t i = 0; i < n; ++i) {
    const auto begin = lowest.begin() + std::max(i - reach, 0L);
    const auto end = lowest.begin() + std::min(i + reach + 1, n);
    result.push_back(std::accumulate(begin, end, 0.0) / static_cast<double>(end - begin));
  }
  return result;
}

/// In a bend of radius R the inner edge of the street must stay well inside R or the ribbon folds
/// over itself.
void squeeze_in_turns(std::vector<RoadFrame>& knots) {
  constexpr double kShareOfRadius = 0.72;
  constexpr int kReach = 9;  // knots
  std::vector<double> left(knots.size(), 1.0);
  std::vector<double> right(knots.size(), 1.0);
  for (std::size_t i = 1; i + 1 < knots.size(); ++i) {
    const Vec3 turn = knots[i + 1].forward - knots[i - 1].forward;
    const double curvature = turn.dot(knots[i].right) / 2.0;  // > 0: right
    const double room = kShareOfRadius / std::max(std::abs(curvature), 1e-9);
    (curvature > 0.0 ? right : left)[i] = std::min(1.0, room / kStreetHalfWidth_m);
  }
  left = smooth_lower_bound(left, kReach);
  right = smooth_lower_bound(right, kReach);
  for (std::size_t i = 0; i < knots.size(); ++i) {
    knots[i].squeeze_left = left[i];
    knots[i].squeeze_right = right[i];
  }
}

constexpr double kMaxSpeed_m_s = 12.0;

/// Twice over: smooth, with smooth derivatives.
std::vector<double> smooth(std::vector<double> values, int reach) {
  const int n = static_cast<int>(values.size());
  for (int pass = 0; pass < 2; ++pass) {
    const std::vector<double> from = values;
    for (int i = 0; i < n; ++i) {
      double sum = 0.0;
      for (int k = -reach; k <= reach; ++k) {
        sum += from[static_cast<std::size_t>(std::clamp(i + k, 0, n - 1))];
      }
      values[static_cast<std::size_t>(i)] = sum / (2 * reach + 1);
    }
  }
  return values;
}

/// Curvature (1/m, > 0 to the right) per knot: straights and turns in alternation, with
/// clothoid-like entries. The first two turns go to different sides.
std::vector<double> draw_curvature(std::size_t num_knots, std::uint64_t seed) {
  Draw draw(seed, 'k');
  std::vector<double> curvature(static_cast<std::size_t>(kRoadBehind_m) + 12, 0.0);
  double side = draw.chance(0.5) ? 1.0 : -1.0;
  for (int turn = 0; curvature.size() < num_knots; ++turn) {
    const double radius_m = draw.in(22.0, 70.0);
    const double angle_rad = radians(draw.in(25.0, 80.0));
    curvature.insert(curvature.end(), static_cast<std::size_t>(radius_m * angle_rad),
                     side / radius_m);
    curvature.insert(curvature.end(), static_cast<std::size_t>(draw.in(10.0, 40.0)), 0.0);
    side = turn == 0 || draw.chance(0.7) ? -side : side;
  }
  curvature.resize(num_knots);
  return smooth(curvature, 4);
}

RoadCurve lay_road(const std::vector<double>& curvature, std::uint64_t seed) {
  Draw draw(seed, 'e');
  const auto wave = [&](double length_m) {
    const double phase = draw.in(0.0, 2.0 * kPi);
    return [=](double s) { return std::sin(2.0 * kPi * s / length_m + phase); };
  };
  const auto hills = wave(170.0);
  const auto bumps = wave(61.0);
  const auto banks = wave(93.0);
  std::vector<Vec3> points;
  std::vector<Vec3> ups;
  double heading_rad = 0.0;
  double x = 0.0;
  double z = 0.0;
  for (const double bend : curvature) {
    const double s = static_cast<double>(points.size());
    points.emplace_back(x, -(0.7 * hills(s) + 0.12 * bumps(s)), z);
    const double bank_rad = radians(0.8 * banks(s)) + 0.5 * bend;
    const Vec3 right(std::cos(heading_rad), 0.0, -std::sin(heading_rad));
    ups.push_back(std::cos(bank_rad) * -Vec3::UnitY() - std::sin(bank_rad) * right);
    const double middle_rad = heading_rad + 0.5 * bend;
    x += std::sin(middle_rad);
    z += std::cos(middle_rad);
    heading_rad += bend;
  }
  return {points, ups};
}

/// Metres per second at each knot: slower in turns, changing gently.
std::vector<double> plan_speed(const std::vector<double>& curvature) {
  constexpr double kMinSpeed_m_s = 8.0;
  constexpr double kComfortable_m_s2 = 3.0;
  std::vector<double> speed;
  for (const double bend : curvature) {
    const double limit = std::sqrt(kComfortable_m_s2 / std::max(std::abs(bend), 1e-6));
    speed.push_back(std::clamp(limit, kMinSpeed_m_s, kMaxSpeed_m_s));
  }
  return smooth(speed, 10);
}

/// How the camera moves against the road.
struct CarBody {
  std::uint64_t seed;
  Sway pitch_rad{seed, 1, radians(0.38), 0.12, 1.7};
  Sway roll_rad{seed, 2, radians(0.38), 0.10, 1.4};
  Sway yaw_rad{seed, 3, radians(0.25), 0.05, 0.5};
  Sway bounce_m{seed, 4, 0.014, 0.3, 1.8};
  Sway drift_m{seed, 5, 0.12, 0.02, 0.2};

  [[nodiscard]] Rigid3 world_from_camera(const RoadCurve& road, double arc_m, double time_s) const {
    constexpr double kAheadOfRearAxle_m = 1.7;  // the body points where the rear axle goes
    const RoadFrame axle = road.at(arc_m - kAheadOfRearAxle_m);
    Eigen::Matrix3d body;
    body << axle.right, -axle.up, axle.forward;
    const Eigen::Matrix3d sway =
        rotation(yaw_rad.at(time_s), pitch_rad.at(time_s), roll_rad.at(time_s));
    return Rigid3::from_matrix(
        body * sway,
        road.at(arc_m).point(drift_m.at(time_s), kCameraHeight_m + bounce_m.at(time_s)));
  }
};

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

/// A polyline with an up direction at each point.
struct Path {
  std::vector<Vec3> points;
  std::vector<Vec3> ups;

  void add(const Vec3& point, const Vec3& up) {
    points.push_back(point);
    ups.push_back(up);
  }
};

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
  const Path knots = resample(ground, 1.0);
  return {knots.points, knots.ups};
}

/// Arc length of the knot nearest to `point` among those near `guess_m`.
double nearest_arc_m(const RoadCurve& road, const Vec3& point, double guess_m) {
  constexpr int kReach = 24;  // knots; a car moves less between two frames
  const int guess = static_cast<int>(guess_m);
  int best = guess;
  const int end = std::min(guess + kReach + 1, road.num_knots());
  const auto distance2 = [&](int i) { return (road.knot(i).position - point).squaredNorm(); };
  for (int i = std::max(guess - kReach, 0); i < end; ++i) {
    best = distance2(i) < distance2(best) ? i : best;
  }
  return best;
}

}  // namespace

RoadCurve::RoadCurve(const std::vector<Vec3>& points, const std::vector<Vec3>& ups) {
  const std::size_t last = points.size() - 1;
  knots_.resize(points.size());
  for (std::size_t i = 0; i <= last; ++i) {
    RoadFrame& frame = knots_[i];
    frame.position = points[i];
    frame.forward = (points[std::min(i + 1, last)] - points[i > 0 ? i - 1 : 0]).normalized();
    frame.right = frame.forward.cross(ups[i]).normalized();
    frame.up = frame.right.cross(frame.forward);
  }
  squeeze_in_turns(knots_);
}

RoadFrame RoadCurve::at(double arc_m) const {
  const double x = std::clamp(arc_m, 0.0, static_cast<double>(num_knots() - 1));
  const int i = std::min(static_cast<int>(x), num_knots() - 2);
  const double t = x - i;
  const RoadFrame& a = knot(i);
  const RoadFrame& b = knot(i + 1);
  const double t2 = t * t;
  const double t3 = t2 * t;
  RoadFrame frame;
  frame.position = (2 * t3 - 3 * t2 + 1) * a.position + (3 * t2 - 2 * t3) * b.position +
                   ((t3 - 2 * t2 + t) * a.forward + (t3 - t2) * b.forward);
  frame.forward = ((1 - t) * a.forward + t * b.forward).normalized();
  frame.right = frame.forward.cross((1 - t) * a.up + t * b.up).normalized();
  frame.up = frame.right.cross(frame.forward);
  frame.squeeze_left = (1 - t) * a.squeeze_left + t * b.squeeze_left;
  frame.squeeze_right = (1 - t) * a.squeeze_right + t * b.squeeze_right;
  return frame;
}

Drive make_own_drive(int num_frames, std::uint64_t seed) {
  constexpr double kInterval_s = 1.0 / kDriveRate_hz;
  const double longest_m = kMaxSpeed_m_s * kInterval_s * num_frames;
  const auto num_knots = static_cast<std::size_t>(kRoadBehind_m + longest_m + kRoadAhead_m);
  const auto curvature = draw_curvature(num_knots, seed);
  const auto speed = plan_speed(curvature);
  Drive drive{lay_road(curvature, seed), {}, {}};
  const CarBody body{seed};
  double arc_m = kRoadBehind_m;
  for (int i = 0; i < num_frames; ++i) {
    drive.world_from_camera.push_back(body.world_from_camera(drive.road, arc_m, kInterval_s * i));
    drive.arcs_m.push_back(arc_m);
    arc_m += kInterval_s * speed[static_cast<std::size_t>(arc_m)];
  }
  return drive;
}

Drive make_drive_along(const Trajectory& world_from_camera) {
  Drive drive{fit_road(choose_keys(world_from_camera)), world_from_camera, {}};
  double arc_m = kRoadBehind_m + kStraightOn_m;
  for (const Rigid3& pose : world_from_camera) {
    arc_m = nearest_arc_m(drive.road, pose.translation, arc_m);
    drive.arcs_m.push_back(arc_m);
  }
  return drive;
}

}  // namespace stemvo::synth
