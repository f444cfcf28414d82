// SPDX-License-Identifier: MIT
#include "synth/drive.hpp"

#include <cmath>
#include <functional>
#include <ranges>

#include <opencv2/imgproc.hpp>

namespace stemvo::synth {
namespace {

/// Smallest value within `reach` knots, then the mean over the same reach: smooth and never above
/// the input, because every value in the mean already is a minimum over a window with this knot.
std::vector<double> smooth_lower_bound(const std::vector<double>& values, int reach) {
  const cv::Mat window = cv::Mat::ones(1, 2 * reach + 1, CV_64F);
  std::vector<double> lowest;
  std::vector<double> sum;
  std::vector<double> count(values.size(), 1.0);  // fewer at the ends
  cv::erode(values, lowest, window);
  cv::filter2D(lowest, sum, -1, window, {-1, -1}, 0.0, cv::BORDER_CONSTANT);
  cv::filter2D(count, count, -1, window, {-1, -1}, 0.0, cv::BORDER_CONSTANT);
  std::ranges::transform(sum, count, sum.begin(), std::divides());
  return sum;
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

/// Twice over: smooth, with smooth derivatives.
std::vector<double> smooth(std::vector<double> values, int reach) {
  const cv::Mat window = cv::Mat::ones(1, 2 * reach + 1, CV_64F);
  for (int pass = 0; pass < 2; ++pass) {
    cv::filter2D(values, values, -1, window, {-1, -1}, 0.0, cv::BORDER_REPLICATE);
    cv::divide(values, static_cast<double>(window.cols), values);
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
  Path path;
  double heading_rad = 0.0;
  double x = 0.0;
  double z = 0.0;
  for (const double bend : curvature) {
    const double s = static_cast<double>(path.points.size());
    const double bank_rad = radians(0.8 * banks(s)) + 0.5 * bend;
    const Vec3 right(std::cos(heading_rad), 0.0, -std::sin(heading_rad));
    path.add({x, -(0.7 * hills(s) + 0.12 * bumps(s)), z},
             std::cos(bank_rad) * -Vec3::UnitY() - std::sin(bank_rad) * right);
    const double middle_rad = heading_rad + 0.5 * bend;
    x += std::sin(middle_rad);
    z += std::cos(middle_rad);
    heading_rad += bend;
  }
  return RoadCurve(path);
}

class Driver {
 public:
  Driver(const std::vector<double>& curvature, std::uint64_t seed)
      : curvature_(curvature), draw_(seed, 's') {
    plan_stop(kRoadBehind_m + 45.0);
  }

  /// For the next interval, no faster than `limit_m_s`.
  double speed_m_s(double arc_m, double limit_m_s, double interval_s) {
    constexpr double kGentle_m_s2 = 2.0;
    const double left_m = std::max(0.0, stop_m_ - arc_m);
    const double brake_m_s = std::sqrt(2.0 * kGentle_m_s2 * left_m);
    speed_m_s_ = std::min({limit_m_s, brake_m_s, speed_m_s_ + kGentle_m_s2 * interval_s});
    if (speed_m_s_ < 0.2) {
      speed_m_s_ = 0.0;
      stand_s_ -= interval_s;
      if (stand_s_ <= 0.0) {
        plan_stop(arc_m + 60.0);
      }
    }
    return speed_m_s_;
  }

 private:
  /// At the straightest place of the 90 m from `begin_m` on.
  void plan_stop(double begin_m) {
    constexpr std::size_t kAhead = 23;  // knots: a crossing begins there
    stand_s_ = draw_.in(4.0, 7.0);
    const auto stops = std::views::iota(static_cast<std::size_t>(begin_m)) | std::views::take(90);
    stop_m_ = static_cast<double>(*std::ranges::min_element(stops, {}, [&](std::size_t stop) {
      double most = 0.0;
      for (std::size_t k = stop; k <= stop + kAhead; ++k) {
        most = std::max(most, std::abs(curvature_[std::min(k, curvature_.size() - 1)]));
      }
      return most;
    }));
  }

  const std::vector<double>& curvature_;
  Draw draw_;
  double speed_m_s_ = 8.0;
  double stop_m_ = 0.0;
  double stand_s_ = 0.0;
};

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

/// Where the camera is beside its first path, by the way that is behind it: standing, it stands.
struct Detour {
  Draw draw;
  double aside_m = draw.chance(0.6) ? draw.in(-0.7, -0.3) : draw.in(0.2, 0.4);  // > 0: right
  double higher_m = draw.in(-0.06, 0.06);
  std::uint64_t key = draw.bits();
  // "Hz" are cycles a metre here.
  Sway sideways_m{key, 1, 0.08, 0.004, 0.02};
  Sway upwards_m{key, 2, 0.008, 0.03, 0.2};
  Sway yaw_rad{key, 3, radians(0.3), 0.005, 0.05};
  Sway pitch_rad{key, 4, radians(0.3), 0.012, 0.17};
  Sway roll_rad{key, 5, radians(0.3), 0.01, 0.14};

  [[nodiscard]] Rigid3 moved(const Rigid3& pose, double way_m) const {
    constexpr double kStep_m = 0.5;
    const double aside = aside_m + sideways_m.at(way_m);
    const double course_rad = (sideways_m.at(way_m + kStep_m) - sideways_m.at(way_m)) / kStep_m;
    const double up = higher_m + upwards_m.at(way_m);
    const Rigid3 first_from_again = Rigid3::from_matrix(
        rotation(course_rad + yaw_rad.at(way_m), pitch_rad.at(way_m), roll_rad.at(way_m)),
        {aside, -up, 0.0});
    return pose * first_from_again;
  }
};

}  // namespace

RoadCurve::RoadCurve(const Path& path, std::vector<RoadPart> parts) : parts_(std::move(parts)) {
  const std::vector<Vec3>& points = path.points;
  const std::size_t last = points.size() - 1;
  knots_.resize(points.size());
  for (std::size_t i = 0; i <= last; ++i) {
    RoadFrame& frame = knots_[i];
    frame.position = points[i];
    frame.forward = (points[std::min(i + 1, last)] - points[i > 0 ? i - 1 : 0]).normalized();
    frame.right = frame.forward.cross(path.ups[i]).normalized();
    frame.up = frame.right.cross(frame.forward);
  }
  squeeze_in_turns(knots_);
  if (parts_.empty()) {
    parts_.push_back({0, num_knots(), 0});
  }
  for (const RoadPart& part : parts_) {
    if (part.shift > 0) {
      std::copy(knots_.begin() + (part.begin - part.shift),
                knots_.begin() + (part.end - part.shift), knots_.begin() + part.begin);
    }
  }
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

Rigid3 pose_at(const Trajectory& poses, double frame) {
  const auto last = static_cast<double>(poses.size() - 1);
  const double at = std::clamp(frame, 0.0, last);
  const auto i = static_cast<std::size_t>(at);
  const Rigid3& from = poses[i];
  const Rigid3& to = poses[std::min(i + 1, poses.size() - 1)];
  const double t = at - std::floor(at);
  return {from.rotation.slerp(t, to.rotation), (1.0 - t) * from.translation + t * to.translation};
}

Drive make_own_drive(int num_frames, std::uint64_t seed, bool stops) {
  constexpr double kInterval_s = 1.0 / kDriveRate_hz;
  constexpr double kMinSpeed_m_s = 8.0;
  constexpr double kMaxSpeed_m_s = 12.0;
  constexpr double kComfortable_m_s2 = 3.0;
  const double longest_m = kMaxSpeed_m_s * kInterval_s * num_frames;
  const auto num_knots = static_cast<std::size_t>(kRoadBehind_m + longest_m + kRoadAhead_m);
  const auto curvature = draw_curvature(num_knots, seed);
  std::vector<double> speed;  // m/s at each knot: slower in turns, changing gently
  for (const double bend : curvature) {
    const double limit = std::sqrt(kComfortable_m_s2 / std::max(std::abs(bend), 1e-6));
    speed.push_back(std::clamp(limit, kMinSpeed_m_s, kMaxSpeed_m_s));
  }
  speed = smooth(speed, 10);
  Drive drive{lay_road(curvature, seed), {}, {}};
  const CarBody body{seed};
  double arc_m = kRoadBehind_m;
  Driver driver(curvature, seed);
  double sway_s = 0.0;  // the car sways while it moves
  for (int i = 0; i < num_frames; ++i) {
    const double time_s = stops ? sway_s : kInterval_s * i;
    drive.world_from_camera.push_back(body.world_from_camera(drive.road, arc_m, time_s));
    drive.arcs_m.push_back(arc_m);
    double now_m_s = speed[static_cast<std::size_t>(arc_m)];
    if (stops) {
      now_m_s = driver.speed_m_s(arc_m, now_m_s, kInterval_s);
      sway_s += kInterval_s * std::min(1.0, now_m_s / 3.0);
    }
    arc_m += kInterval_s * now_m_s;
  }
  return drive;
}

void drive_again(std::uint64_t seed, int visit, Drive& drive) {
  const Trajectory first = drive.world_from_camera;
  const std::vector<double> first_arcs_m = drive.arcs_m;
  Draw draw(seed, 'V', visit);
  const double speed = draw.in(0.9, 1.0);
  double at = draw.in(0.2, 0.8);  // frames of the first drive
  const Detour detour{draw};
  double way_m = 0.0;
  Vec3 before = first.front().translation;
  for (std::size_t i = 0; i < first.size(); ++i, at += speed) {
    const Rigid3 pose = pose_at(first, at);
    way_m += (pose.translation - before).norm();
    before = pose.translation;
    drive.world_from_camera[i] = detour.moved(pose, way_m);
    drive.arcs_m[i] = first_arcs_m[std::min(static_cast<std::size_t>(at), first.size() - 1)];
  }
}

}  // namespace stemvo::synth
