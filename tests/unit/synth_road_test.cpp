// SPDX-License-Identifier: MIT
#include "support/test.hpp"
#include "synth/drive.hpp"

namespace stemvo::synth {
namespace {

double degrees(double radians) { return radians / kDeg; }

double deviation(const std::vector<double>& values) {
  cv::Scalar mean;
  cv::Scalar sigma;
  cv::meanStdDev(values, mean, sigma);
  return sigma[0];
}

/// How the cameras stand on their road.
struct AgainstRoad {
  std::vector<double> pitch_deg;
  std::vector<double> roll_deg;
  std::vector<double> height_m;

  explicit AgainstRoad(const Drive& drive) {
    for (std::size_t i = 0; i < drive.arcs_m.size(); ++i) {
      const Rigid3& pose = drive.world_from_camera[i];
      RoadFrame road = drive.road.at(drive.arcs_m[i]);
      road = drive.road.at(drive.arcs_m[i] + (pose.translation - road.position).dot(road.forward));
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

TEST(OwnDrive, DefaultIsWhatItAlwaysWas) {
  const Drive drive = make_own_drive(20, 7);
  const Rigid3 last = drive.world_from_camera.front().inverse() * drive.world_from_camera.back();
  EXPECT_NEAR(last.translation.x(), 1.3654172970722067e+00, 1e-9);
  EXPECT_NEAR(last.translation.y(), -9.3043270156147884e-02, 1e-9);
  EXPECT_NEAR(last.translation.z(), 2.2395173912182045e+01, 1e-9);
}

TEST(FittedRoad, ACarMayStand) {
  Trajectory poses(5);
  poses.emplace_back(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.0, 0.0, 1.0));
  for (const double height : AgainstRoad(make_drive_along(poses)).height_m) {
    EXPECT_NEAR(height, kCameraHeight_m, 1e-6);
  }
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
  const AgainstRoad against(drive);
  EXPECT_NEAR(deviation(against.pitch_deg), degrees(0.007 / std::sqrt(2.0)), 0.03);
  for (const double height : against.height_m) {
    EXPECT_NEAR(height, kCameraHeight_m, 0.1);
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
  const RoadCurve road({points, std::vector<Eigen::Vector3d>(60, -Eigen::Vector3d::UnitY())});
  for (int i = 0; i + 1 < road.num_knots(); ++i) {
    for (const double side : {-1.0, 1.0}) {
      const Eigen::Vector3d edge = road.knot(i + 1).point(side * kStreetHalfWidth_m, 0.0) -
                                   road.knot(i).point(side * kStreetHalfWidth_m, 0.0);
      EXPECT_GT(edge.dot(road.knot(i).forward), 0.0) << "knot " << i << ", side " << side;
    }
  }
}

}  // namespace
}  // namespace stemvo::synth
