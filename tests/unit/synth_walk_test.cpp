// SPDX-License-Identifier: MIT
#include "support/test.hpp"
#include "synth/drive.hpp"

namespace stemvo::synth {
namespace {

constexpr double kRate_hz = 30.0;
constexpr int kFrames = 600;  // 20 s

double degrees(double radians) { return radians / kDeg; }

Eigen::Vector3d level(const Eigen::Vector3d& v) { return {v.x(), 0.0, v.z()}; }

/// Horizontal way between two frames.
double way_m(const Trajectory& poses, std::size_t begin, std::size_t end) {
  double sum = 0.0;
  for (std::size_t i = begin; i < end; ++i) {
    sum += level(poses[i + 1].translation - poses[i].translation).norm();
  }
  return sum;
}

TEST(Walk, IsSmooth) {
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    const Trajectory poses = make_walk(kFrames, seed, {.rate_hz = kRate_hz}).world_from_camera;
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

TEST(Walk, KeepsItsMeanSpeed) {
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    const Trajectory poses = make_walk(kFrames, seed, {.rate_hz = kRate_hz}).world_from_camera;
    EXPECT_NEAR(way_m(poses, 0, kFrames - 1) * kRate_hz / (kFrames - 1), 0.5, 0.025) << seed;
  }
}

/// Frames of another rate are other moments of the same walk, where both last equally long.
TEST(Walk, IsTheSameAtAnyRate) {
  const Trajectory fast = make_walk(600, 4, {.rate_hz = 30.0}).world_from_camera;
  const Trajectory slow = make_walk(200, 4, {.rate_hz = 10.0}).world_from_camera;
  for (std::size_t i = 0; i < slow.size(); ++i) {
    const Rigid3 between = slow[i].inverse() * fast[3 * i];
    ASSERT_LT(between.translation.norm() + between.angle_rad(), 1e-9);
  }
}

TEST(Walk, TurnsAsFastAsAsked) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const Walk walk = make_walk(kFrames, seed, {.rate_hz = kRate_hz, .turn_rate_rad_s = 3.49});
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
    Scene scene(walk.world_from_camera[0].translation, Eigen::Vector3d(0.0, -1.0, 0.0), 0.5);
    add_courtyard(walk.courtyard, scene);
    return scene.faces();
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
