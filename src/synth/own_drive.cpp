// SPDX-License-Identifier: MIT
#include <algorithm>

#include "synth/drive.hpp"

namespace stemvo::synth {
namespace {

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

}  // namespace

Drive make_own_drive(int num_frames, std::uint64_t seed) {
  constexpr double kInterval_s = 1.0 / kDriveRate_hz;
  const double longest_m = kMaxSpeed_m_s * kInterval_s * num_frames;
  const auto num_knots = static_cast<std::size_t>((kRoadBehind_m + longest_m + kRoadAhead_m));
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

}  // namespace stemvo::synth
