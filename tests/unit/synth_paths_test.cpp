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

TEST(OwnDrive, DefaultIsWhatItAlwaysWas) {
  const Drive drive = make_own_drive(20, 7);
  const Rigid3 last = drive.world_from_camera.front().inverse() * drive.world_from_camera.back();
  EXPECT_NEAR(last.translation.x(), 1.3654172970722067e+00, 1e-9);
  EXPECT_NEAR(last.translation.y(), -9.3043270156147884e-02, 1e-9);
  EXPECT_NEAR(last.translation.z(), 2.2395173912182045e+01, 1e-9);
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

constexpr double kRate_hz = 30.0;
constexpr int kFrames = 600;  // 20 s

TEST(Walk, IsSmooth) {
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    const Trajectory poses = make_walk(kFrames, seed, {.walk_rate_hz = kRate_hz}).world_from_camera;
    for (std::size_t i = 1; i + 1 < poses.size(); ++i) {
      const Eigen::Vector3d before = (poses[i].translation - poses[i - 1].translation) * kRate_hz;
      const Eigen::Vector3d after = (poses[i + 1].translation - poses[i].translation) * kRate_hz;
      ASSERT_LT(before.norm(), 1.2) << "m/s, seed " << seed << ", frame " << i;
      ASSERT_LT((after - before).norm() * kRate_hz, 4.0) << "m/s^2, seed " << seed << " at " << i;
      const double turn = degrees((poses[i].inverse() * poses[i + 1]).angle_rad());
      ASSERT_LT(turn * kRate_hz, 120.0) << "deg/s, seed " << seed << ", frame " << i;
      ASSERT_NEAR(-poses[i].translation.y(), 1.5, 0.15);
    }
  }
}

/// Frames of another rate are other moments of the same walk, where both last equally long.
TEST(Walk, IsTheSameAtAnyRate) {
  const Trajectory fast = make_walk(600, 4, {.walk_rate_hz = 30.0}).world_from_camera;
  const Trajectory slow = make_walk(200, 4, {.walk_rate_hz = 10.0}).world_from_camera;
  for (std::size_t i = 0; i < slow.size(); ++i) {
    const Rigid3 between = slow[i].inverse() * fast[3 * i];
    ASSERT_LT(between.translation.norm() + between.angle_rad(), 1e-9);
  }
}

TEST(Walk, TurnsAsFastAsAsked) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const Walk walk =
        make_walk(kFrames, seed, {.walk_rate_hz = kRate_hz, .turn_rate_deg_s = 200.0});
    double most_deg_s = 0.0;
    for (std::size_t i = 1; i < walk.world_from_camera.size(); ++i) {
      const Rigid3 step = walk.world_from_camera[i - 1].inverse() * walk.world_from_camera[i];
      most_deg_s = std::max(most_deg_s, degrees(step.angle_rad()) * kRate_hz);
    }
    EXPECT_NEAR(most_deg_s, 200.0, 15.0);
  }
}

TEST(Walk, MayBeBetweenBlankWalls) {
  const auto faces = [](bool is_blank) {
    const Walk walk = make_walk(2, 1, {.blank_walls = is_blank});
    Scene scene{walk.world_from_camera[0].translation, Eigen::Vector3d(0.0, -1.0, 0.0), 0.5};
    add_courtyard(walk.courtyard, scene);
    return scene.faces;
  };
  double plain_m2 = 0.0;  // of large upright faces of one colour
  for (const Face& face : faces(true)) {
    const Eigen::Vector3f a = face.points[1] - face.points[0];
    const Eigen::Vector3f b = face.points[2] - face.points[0];
    const float area_m2 = a.cross(b).norm();
    const bool is_upright = std::abs(a.cross(b).y()) < 0.1F * area_m2;
    plain_m2 += face.style.material == nullptr && is_upright && area_m2 > 10.0F ? area_m2 : 0.0F;
  }
  EXPECT_GT(plain_m2, 80.0);
  EXPECT_LT(faces(true).size(), faces(false).size());
}

}  // namespace
}  // namespace stemvo::synth
