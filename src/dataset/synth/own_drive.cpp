// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

#include "dataset/synth/drive.hpp"
#include "dataset/synth/hash.hpp"
#include "dataset/synth/sway.hpp"

namespace stemvo::synth {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kMinSpeed_m_s = 8.0;
constexpr double kMaxSpeed_m_s = 12.0;
/// Turns get wider above this speed, so that no car has to skid.
constexpr double kTightestTurns_m_s = 12.0;

double radians(double degrees) { return degrees * kPi / 180.0; }

std::vector<double> moving_average(const std::vector<double>& values, int reach) {
  std::vector<double> result(values.size());
  const int n = static_cast<int>(values.size());
  for (int i = 0; i < n; ++i) {
    double sum = 0.0;
    for (int k = -reach; k <= reach; ++k) {
      sum += values[static_cast<std::size_t>(std::clamp(i + k, 0, n - 1))];
    }
    result[static_cast<std::size_t>(i)] = sum / (2 * reach + 1);
  }
  return result;
}

/// Curvature (1/m, > 0 to the right) per knot: straights and turns in alternation, with smooth
/// entries (the averages make them clothoid-like). The first two turns go to different sides.
std::vector<double> draw_curvature(std::size_t num_knots, std::uint64_t seed, const Pace& pace) {
  Draw draw(seed, 'k');
  const double faster = pace.speed_m_s.value_or(0.0) / kTightestTurns_m_s;
  const double widened = std::max(1.0, faster * faster);
  std::vector<double> curvature(static_cast<std::size_t>(kRoadBehind_m) + 12, 0.0);
  double side = draw.chance(0.5) ? 1.0 : -1.0;
  for (int turn = 0; curvature.size() < num_knots; ++turn) {
    const double radius_m = widened * draw.in(22.0, 70.0);
    const double angle_rad = radians(draw.in(25.0, 80.0));
    curvature.insert(curvature.end(), static_cast<std::size_t>(radius_m * angle_rad),
                     side / radius_m);
    curvature.insert(curvature.end(), static_cast<std::size_t>(draw.in(10.0, 40.0)), 0.0);
    side = turn == 0 || draw.chance(0.7) ? -side : side;
  }
  curvature.resize(num_knots);
  return moving_average(moving_average(curvature, 4), 4);
}

RoadCurve lay_road(const std::vector<double>& curvature, std::uint64_t seed) {
  Draw draw(seed, 'e');
  const double phase_1 = draw.in(0.0, 2.0 * kPi);
  const double phase_2 = draw.in(0.0, 2.0 * kPi);
  const double phase_3 = draw.in(0.0, 2.0 * kPi);
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector3d> ups;
  double heading_rad = 0.0;
  double x = 0.0;
  double z = 0.0;
  for (std::size_t i = 0; i < curvature.size(); ++i) {
    const double s = static_cast<double>(i) * kKnotSpacing_m;
    const double hill_m = 0.7 * std::sin(2.0 * kPi * s / 170.0 + phase_1) +
                          0.12 * std::sin(2.0 * kPi * s / 61.0 + phase_2);
    const double bank_rad =
        radians(0.8 * std::sin(2.0 * kPi * s / 93.0 + phase_3)) + 0.5 * curvature[i];
    points.emplace_back(x, -hill_m, z);
    const Eigen::Vector3d right(std::cos(heading_rad), 0.0, -std::sin(heading_rad));
    ups.push_back(std::cos(bank_rad) * -Eigen::Vector3d::UnitY() - std::sin(bank_rad) * right);
    const double middle_rad = heading_rad + 0.5 * curvature[i] * kKnotSpacing_m;
    x += kKnotSpacing_m * std::sin(middle_rad);
    z += kKnotSpacing_m * std::cos(middle_rad);
    heading_rad += curvature[i] * kKnotSpacing_m;
  }
  return {points, ups};
}

/// Metres per second at each knot: slower in turns, changing gently.
std::vector<double> plan_speed(const std::vector<double>& curvature) {
  constexpr double kComfortable_m_s2 = 3.0;
  std::vector<double> speed(curvature.size());
  for (std::size_t i = 0; i < speed.size(); ++i) {
    const double limit = std::sqrt(kComfortable_m_s2 / std::max(std::abs(curvature[i]), 1e-6));
    speed[i] = std::clamp(limit, kMinSpeed_m_s, kMaxSpeed_m_s);
  }
  return moving_average(moving_average(speed, 10), 10);
}

/// Scales the speeds so that the way of `length_m` from the first camera on is driven at
/// `mean_m_s`.
void set_mean_speed(double mean_m_s, double length_m, std::vector<double>& speed) {
  const auto begin = static_cast<std::size_t>(kRoadBehind_m / kKnotSpacing_m);
  const auto count = static_cast<std::size_t>(length_m / kKnotSpacing_m) + 1;
  double time_s = 0.0;
  for (std::size_t i = begin; i < begin + count; ++i) {
    time_s += kKnotSpacing_m / speed[i];
  }
  const double factor = mean_m_s * time_s / (static_cast<double>(count) * kKnotSpacing_m);
  for (double& value : speed) {
    value *= factor;
  }
}

/// How the camera moves against the road.
class CarBody {
 public:
  explicit CarBody(std::uint64_t seed)
      : pitch_rad_(seed, 1, radians(0.38), 0.12, 1.7),
        roll_rad_(seed, 2, radians(0.38), 0.10, 1.4),
        yaw_rad_(seed, 3, radians(0.25), 0.05, 0.5),
        bounce_m_(seed, 4, 0.014, 0.3, 1.8),
        drift_m_(seed, 5, 0.12, 0.02, 0.2) {}

  [[nodiscard]] Rigid3 world_from_camera(const RoadCurve& road, double arc_m, double time_s) const {
    constexpr double kAheadOfRearAxle_m = 1.7;  // the body points where the rear axle goes
    const RoadFrame here = road.at(arc_m);
    const RoadFrame axle = road.at(arc_m - kAheadOfRearAxle_m);
    Eigen::Matrix3d body;
    body << axle.right, -axle.up, axle.forward;
    const auto turn = [](double angle_rad, const Eigen::Vector3d& axis) {
      return Eigen::AngleAxisd(angle_rad, axis);
    };
    const Eigen::Matrix3d sway = (turn(yaw_rad_.at(time_s), Eigen::Vector3d::UnitY()) *
                                  turn(pitch_rad_.at(time_s), Eigen::Vector3d::UnitX()) *
                                  turn(roll_rad_.at(time_s), Eigen::Vector3d::UnitZ()))
                                     .toRotationMatrix();
    return Rigid3::from_matrix(
        body * sway, here.point(drift_m_.at(time_s), kCameraHeight_m + bounce_m_.at(time_s)));
  }

 private:
  Sway pitch_rad_;
  Sway roll_rad_;
  Sway yaw_rad_;
  Sway bounce_m_;
  Sway drift_m_;
};

}  // namespace

Drive make_own_drive(int num_frames, std::uint64_t seed, const Pace& pace) {
  const double interval_s = 1.0 / pace.rate_hz;
  const double longest_m = pace.speed_m_s.value_or(kMaxSpeed_m_s) * interval_s * num_frames;
  const auto num_knots =
      static_cast<std::size_t>((kRoadBehind_m + longest_m + kRoadAhead_m) / kKnotSpacing_m);
  const auto curvature = draw_curvature(num_knots, seed, pace);
  auto speed = plan_speed(curvature);
  if (pace.speed_m_s) {
    set_mean_speed(*pace.speed_m_s, longest_m, speed);
  }
  Drive drive;
  drive.roads.push_back(lay_road(curvature, seed));
  const CarBody body(seed);
  double arc_m = kRoadBehind_m;
  for (int i = 0; i < num_frames; ++i) {
    drive.world_from_camera.push_back(
        body.world_from_camera(drive.roads.front(), arc_m, interval_s * i));
    drive.places.push_back({0, arc_m});
    arc_m += interval_s * speed[static_cast<std::size_t>(arc_m / kKnotSpacing_m)];
  }
  return drive;
}

}  // namespace stemvo::synth
