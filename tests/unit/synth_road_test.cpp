// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "synth/drive.hpp"
#include "synth/street.hpp"

namespace stemvo::synth {
namespace {

double degrees(double radians) { return radians * 180.0 / std::numbers::pi; }

double deviation(const std::vector<double>& values) {
  double mean = 0.0;
  for (const double value : values) {
    mean += value / static_cast<double>(values.size());
  }
  double square = 0.0;
  for (const double value : values) {
    square += (value - mean) * (value - mean) / static_cast<double>(values.size());
  }
  return std::sqrt(square);
}

/// How the cameras stand on their road.
struct AgainstRoad {
  std::vector<double> pitch_deg;
  std::vector<double> roll_deg;
  std::vector<double> height_m;

  explicit AgainstRoad(const Drive& drive) {
    for (std::size_t i = 0; i < drive.positions.size(); ++i) {
      const RoadCurve& curve = drive.roads[drive.positions[i].road];
      const Rigid3& pose = drive.world_from_camera[i];
      RoadFrame road = curve.at(drive.positions[i].arc_m);
      road =
          curve.at(drive.positions[i].arc_m + (pose.translation - road.position).dot(road.forward));
      const Eigen::Matrix3d r = pose.rotation_matrix();
      pitch_deg.push_back(degrees(std::asin(r.col(2).dot(road.up))));
      roll_deg.push_back(degrees(std::asin(-r.col(0).dot(road.up))));
      height_m.push_back((pose.translation - road.position).dot(road.up));
    }
  }
};

TEST(OwnDrive, MovesLikeACar) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    const Drive drive = make_own_drive(100, seed);
    double most_left_deg = 0.0;
    double most_right_deg = 0.0;
    double heading_deg = 0.0;
    for (std::size_t i = 1; i < drive.world_from_camera.size(); ++i) {
      const Rigid3 step = drive.world_from_camera[i - 1].inverse() * drive.world_from_camera[i];
      EXPECT_GT(step.translation.norm(), 0.75);
      EXPECT_LT(step.translation.norm(), 1.25);
      EXPECT_GT(step.translation.z(), 0.95 * step.translation.norm());
      EXPECT_LT(degrees(step.angle_rad()), 5.0);
      const double before = heading_deg;
      heading_deg += degrees(step.rotation_matrix().col(2).x());
      most_left_deg = std::min(most_left_deg, heading_deg - before);
      most_right_deg = std::max(most_right_deg, heading_deg - before);
    }
    EXPECT_LT(most_left_deg, -0.5) << "turns left, seed " << seed;
    EXPECT_GT(most_right_deg, 0.5) << "turns right, seed " << seed;
  }
}

/// The mean of any rate and speed, and never faster in a turn than in a straight.
TEST(OwnDrive, KeepsTheSpeedThatIsAsked) {
  for (const double rate_hz : {5.0, 10.0, 30.0}) {
    for (const double speed_m_s : {0.5, 5.0, 10.0, 30.0}) {
      const int frames = static_cast<int>(20.0 * rate_hz) + 1;
      const Drive drive = make_own_drive(frames, 2, {rate_hz, speed_m_s});
      double way_m = 0.0;
      double fastest_m_s = 0.0;
      double hardest_m_s2 = 0.0;
      for (std::size_t i = 1; i < drive.positions.size(); ++i) {
        const double step_m = drive.positions[i].arc_m - drive.positions[i - 1].arc_m;
        way_m += step_m;
        fastest_m_s = std::max(fastest_m_s, step_m * rate_hz);
        const RoadCurve& road = drive.roads.front();
        const double bend = (road.at(drive.positions[i].arc_m + 2.0).forward -
                             road.at(drive.positions[i].arc_m - 2.0).forward)
                                .norm() /
                            4.0;
        hardest_m_s2 = std::max(hardest_m_s2, bend * speed_m_s * speed_m_s);
      }
      EXPECT_NEAR(way_m / 20.0, speed_m_s, 0.03 * speed_m_s);
      EXPECT_LT(fastest_m_s, 1.5 * speed_m_s);
      EXPECT_LT(hardest_m_s2, 8.0) << "at " << speed_m_s << " m/s";
    }
  }
}

/// Nodding is a matter of time, not of frames.
TEST(OwnDrive, NodsAtTheSamePaceAtAnyRate) {
  const AgainstRoad slow(make_own_drive(100, 3, {.rate_hz = 10.0, .speed_m_s = 5.0}));
  const AgainstRoad fast(make_own_drive(300, 3, {.rate_hz = 30.0, .speed_m_s = 5.0}));
  double error = 0.0;
  for (std::size_t i = 0; i < slow.pitch_deg.size(); ++i) {
    error = std::max(error, std::abs(slow.pitch_deg[i] - fast.pitch_deg[3 * i]));
  }
  EXPECT_LT(error, 0.1);
  EXPECT_GT(deviation(slow.pitch_deg), 0.25);
}

/// Numbers of a drive of before there were rates and speeds.
TEST(OwnDrive, DefaultIsWhatItAlwaysWas) {
  const Drive drive = make_own_drive(20, 7);
  const Rigid3 last = drive.world_from_camera.front().inverse() * drive.world_from_camera.back();
  EXPECT_NEAR(last.translation.x(), 1.3654172970722067e+00, 1e-9);
  EXPECT_NEAR(last.translation.y(), -9.3043270156147884e-02, 1e-9);
  EXPECT_NEAR(last.translation.z(), 2.2395173912182045e+01, 1e-9);
}

TEST(FittedRoad, LongStepsAreNoJumpsAtALowRate) {
  Trajectory poses;
  for (int i = 0; i < 20; ++i) {
    poses.emplace_back(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.0, 0.0, 20.0 * i));
  }
  EXPECT_EQ(make_drive_along(poses).roads.size(), 20U);
  EXPECT_EQ(make_drive_along(poses, 1.0).roads.size(), 1U);
}

TEST(OwnDrive, PitchesRollsAndBouncesAgainstTheRoad) {
  const Drive drive = make_own_drive(600, 1);
  const AgainstRoad against(drive);
  EXPECT_GT(deviation(against.pitch_deg), 0.25);
  EXPECT_LT(deviation(against.pitch_deg), 0.55);
  EXPECT_GT(deviation(against.roll_deg), 0.25);
  EXPECT_LT(deviation(against.roll_deg), 0.6);
  for (const double height : against.height_m) {
    EXPECT_NEAR(height, kCameraHeight_m, 0.08);
  }
}

/// A nodding camera on a hill: the hill goes into the road, the nodding stays in the camera.
TEST(FittedRoad, FollowsHillsAndLeavesThePitchToTheCamera) {
  Trajectory poses;
  constexpr double kHill_m = 3.0;
  constexpr double kWave_m = 200.0;
  for (int i = 0; i < 400; ++i) {
    const double phase = 2.0 * std::numbers::pi * i / kWave_m;
    const double slope = kHill_m * 2.0 * std::numbers::pi / kWave_m * std::cos(phase);
    const double nod_rad = 0.007 * std::sin(2.0 * std::numbers::pi * i / 9.0);
    poses.emplace_back(
        Eigen::Quaterniond(Eigen::AngleAxisd(std::atan(slope) + nod_rad, Eigen::Vector3d::UnitX())),
        Eigen::Vector3d(0.0, -kHill_m * std::sin(phase), i));
  }
  const Drive drive = make_drive_along(poses);
  ASSERT_EQ(drive.roads.size(), 1U);
  const AgainstRoad against(drive);
  EXPECT_NEAR(deviation(against.pitch_deg), degrees(0.007 / std::sqrt(2.0)), 0.03);
  for (const double height : against.height_m) {
    EXPECT_NEAR(height, kCameraHeight_m, 0.1);
  }
}

TEST(FittedRoad, JumpsMakeRoadsOfTheirOwnAndStandingDoesNot) {
  Trajectory poses(5);
  poses.emplace_back(Eigen::Quaterniond::Identity(), Eigen::Vector3d(100.0, 0.0, 0.0));
  poses.emplace_back(Eigen::Quaterniond::Identity(), Eigen::Vector3d(100.0, 0.0, 1.0));
  const Drive drive = make_drive_along(poses);
  ASSERT_EQ(drive.roads.size(), 2U);
  EXPECT_EQ(drive.positions[4].road, 0U);
  EXPECT_EQ(drive.positions[5].road, 1U);
  for (const double height : AgainstRoad(drive).height_m) {
    EXPECT_NEAR(height, kCameraHeight_m, 1e-6);
  }
}

/// Squeezed to fit inside the turn: lines at the sides never run backwards.
TEST(RoadCurveTest, TightTurnsDoNotFoldTheStreet) {
  std::vector<Eigen::Vector3d> points;
  constexpr double kRadius_m = 6.0;
  for (int i = 0; i < 60; ++i) {
    const double before = std::min(i - 20.0, 0.0);
    const double angle = std::clamp((i - 20.0) / kRadius_m, 0.0, std::numbers::pi / 2.0);
    const double after = std::max(i - 20.0 - kRadius_m * std::numbers::pi / 2.0, 0.0);
    points.emplace_back(kRadius_m * (1.0 - std::cos(angle)) + after, 0.0,
                        before + kRadius_m * std::sin(angle));
  }
  const RoadCurve road(points, std::vector<Eigen::Vector3d>(60, -Eigen::Vector3d::UnitY()));
  for (int i = 0; i + 1 < road.num_knots(); ++i) {
    for (const double side : {-1.0, 1.0}) {
      const Eigen::Vector3d edge = road.knot(i + 1).point(side * kStreetHalfWidth_m, 0.0) -
                                   road.knot(i).point(side * kStreetHalfWidth_m, 0.0);
      EXPECT_GT(edge.dot(road.knot(i).forward), 0.0) << "knot " << i << ", side " << side;
    }
  }
}

TEST(VisibleWindow, EndsWhereTheRoadComesBack) {
  std::vector<Eigen::Vector3d> straight;
  std::vector<Eigen::Vector3d> ring;
  for (int i = 0; i < 500; ++i) {
    straight.emplace_back(0.0, 0.0, i);
    ring.emplace_back(25.0 * std::cos(i / 25.0), 0.0, 25.0 * std::sin(i / 25.0));
  }
  const std::vector<Eigen::Vector3d> ups(500, -Eigen::Vector3d::UnitY());
  const RoadWindow open = visible_window(RoadCurve(straight, ups), 200.0);
  EXPECT_EQ(open.begin, 140);
  EXPECT_EQ(open.end, 371);
  const RoadWindow closed = visible_window(RoadCurve(ring, ups), 200.0);
  EXPECT_LT(closed.end - closed.begin, 157) << "once around is 157 m";
  EXPECT_GT(closed.end, 230);
  EXPECT_LT(closed.begin, 195);
}

}  // namespace
}  // namespace stemvo::synth
