// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "synth/drive.hpp"

namespace stemvo::synth {
namespace {

constexpr double kRate_hz = 30.0;
constexpr int kFrames = 600;  // 20 s

double degrees(double radians) { return radians * 180.0 / std::numbers::pi; }

Eigen::Vector3d level(const Eigen::Vector3d& v) { return {v.x(), 0.0, v.z()}; }

/// Horizontal way between two frames.
double way_m(const Trajectory& poses, std::size_t begin, std::size_t end) {
  double sum = 0.0;
  for (std::size_t i = begin; i < end; ++i) {
    sum += level(poses[i + 1].translation - poses[i].translation).norm();
  }
  return sum;
}

/// The camera looks so far to the right of where it goes.
double aside_deg(const Trajectory& poses, std::size_t i) {
  const Eigen::Vector3d course = level(poses[i + 3].translation - poses[i - 3].translation);
  const Eigen::Vector3d view = level(poses[i].rotation_matrix().col(2));
  return degrees(std::atan2(course.cross(view).y(), course.dot(view)));
}

double distance_to_edge_m(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  const Eigen::Vector3d edge = b - a;
  const double t = std::clamp(-a.dot(edge) / std::max(edge.squaredNorm(), 1e-12), 0.0, 1.0);
  return (a + t * edge).norm();
}

/// From the camera, at the origin of the face's points, to a convex polygon.
double distance_m(const Face& face) {
  std::vector<Eigen::Vector3d> points;
  for (std::size_t i = 0; i < face.num_points; ++i) {
    points.emplace_back(face.points[i].cast<double>());
  }
  const Eigen::Vector3d normal = (points[1] - points[0]).cross(points[2] - points[0]).normalized();
  const Eigen::Vector3d foot = normal.dot(points[0]) * normal;
  double nearest = std::numeric_limits<double>::max();
  int left = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d& a = points[i];
    const Eigen::Vector3d& b = points[(i + 1) % points.size()];
    left += normal.dot((b - a).cross(foot - a)) >= 0.0 ? 1 : 0;
    nearest = std::min(nearest, distance_to_edge_m(a, b));
  }
  const bool is_inside = normal.norm() > 0.5 && left == static_cast<int>(points.size());
  return is_inside ? foot.norm() : nearest;  // without area: its edges
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

TEST(Walk, ComesNearToNothing) {
  double nearest = std::numeric_limits<double>::max();
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    const Walk walk = make_walk(1800, seed, {.rate_hz = kRate_hz});
    for (std::size_t i = 0; i < walk.world_from_camera.size(); i += 15) {
      Scene scene(walk.world_from_camera[i].translation, Eigen::Vector3d(0.0, -1.0, 0.0), 0.5);
      add_courtyard(walk.courtyard, scene);
      for (const Face& face : scene.faces()) {
        nearest = std::min(nearest, distance_m(face));
      }
      ASSERT_GT(nearest, 0.5) << "seed " << seed << ", frame " << i;
    }
  }
  EXPECT_LT(nearest, 1.0) << "but it passes by things closely";
}

TEST(Walk, TurnsGlancesAsideAndPausesWithin20Seconds) {
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    const Trajectory poses = make_walk(kFrames, seed, {.rate_hz = kRate_hz}).world_from_camera;
    double most_turned_deg = 0.0;  // in 3 s
    double most_aside_deg = 0.0;   // while walking on
    double least_way_m = 1.0;      // in 1 s
    for (std::size_t i = 15; i + 75 < poses.size(); ++i) {
      const double in_one_s_m = way_m(poses, i - 15, i + 15);
      least_way_m = std::min(least_way_m, in_one_s_m);
      if (in_one_s_m > 0.4) {
        most_aside_deg = std::max(most_aside_deg, std::abs(aside_deg(poses, i)));
      }
      const Rigid3 turn = poses[i - 15].inverse() * poses[i + 75];
      most_turned_deg = std::max(most_turned_deg, degrees(turn.angle_rad()));
    }
    EXPECT_GT(most_turned_deg, 75.0) << "turns on the spot, seed " << seed;
    EXPECT_GT(most_aside_deg, 25.0) << "glances aside, seed " << seed;
    EXPECT_LT(least_way_m, 0.12) << "pauses, seed " << seed;
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
