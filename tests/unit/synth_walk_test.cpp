// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "synth/walk.hpp"

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

/// Mean horizontal speed of a whole walk.
double mean_speed_m_s(const Trajectory& poses, double rate_hz) {
  return way_m(poses, 0, poses.size() - 1) * rate_hz / static_cast<double>(poses.size() - 1);
}

std::size_t frame_at(double time_s) {
  return static_cast<std::size_t>(std::clamp(std::lround(time_s * kRate_hz), 0L, kFrames - 1L));
}

/// Where the camera glances, to the right of where it goes.
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
  for (int i = 0; i < face.num_points; ++i) {
    points.emplace_back(face.points[static_cast<std::size_t>(i)].cast<double>());
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
    ASSERT_EQ(poses.size(), static_cast<std::size_t>(kFrames));
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

TEST(Walk, KeepsItsMeanSpeedAtAnyRate) {
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    for (const double speed_m_s : {0.25, 0.5, 0.8}) {
      for (const double rate_hz : {10.0, 30.0}) {
        const int frames = static_cast<int>(20.0 * rate_hz);
        const Walk walk = make_walk(frames, seed, {rate_hz, speed_m_s});
        EXPECT_NEAR(mean_speed_m_s(walk.world_from_camera, rate_hz), speed_m_s, 0.05 * speed_m_s)
            << "seed " << seed;
      }
    }
    const Walk usual = make_walk(900, seed, {.rate_hz = kRate_hz});
    EXPECT_NEAR(mean_speed_m_s(usual.world_from_camera, kRate_hz), 0.5, 0.025);
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
      const Scene scene = build_courtyard(walk.courtyard, walk.world_from_camera[i].translation,
                                          Eigen::Vector3d(0.0, -1.0, 0.0));
      for (const Face& face : scene.faces()) {
        nearest = std::min(nearest, distance_m(face));
      }
      ASSERT_GT(nearest, 0.5) << "seed " << seed << ", frame " << i;
    }
  }
  EXPECT_LT(nearest, 1.0) << "but it passes by things closely";
}

TEST(Walk, TurnsGlancesAsideAndPausesWithin20Seconds) {
  int left = 0;
  int right = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    const WalkPlan plan = plan_walk(lay_courtyard(seed), 20.0, kWalkSpeed_m_s, seed);
    int turns = 0;
    int pauses = 0;
    for (const WalkPhase& phase : plan.phases) {
      const double angle_deg = degrees(phase.heading_to_rad - phase.heading_from_rad);
      if (phase.is_turn() && phase.end_s() <= 20.0) {
        EXPECT_NEAR(std::abs(angle_deg), 90.0, 12.0);
        ++turns;
        ++(angle_deg < 0.0 ? left : right);
      } else if (phase.is_pause() && phase.end_s() <= 20.0) {
        EXPECT_NEAR(phase.duration_s, 1.1, 0.3);
        ++pauses;
      }
    }
    const auto glances =
        std::count_if(plan.glances.begin(), plan.glances.end(), [](const auto& glance) {
          const double angle_deg = std::abs(degrees(glance.angle_rad));
          EXPECT_GE(angle_deg, 29.9);
          EXPECT_LE(angle_deg, 60.1);
          return glance.end_s() <= 20.0;
        });
    EXPECT_GE(turns, 2) << "seed " << seed;
    EXPECT_GE(glances, 2) << "seed " << seed;
    EXPECT_GE(pauses, 1) << "seed " << seed;
  }
  EXPECT_GT(left, 20);
  EXPECT_GT(right, 20);
}

/// What is planned is in the poses.
TEST(Walk, PosesDoWhatIsPlanned) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    const Walk walk = make_walk(kFrames, seed, {.rate_hz = kRate_hz});
    const Trajectory& poses = walk.world_from_camera;
    const WalkPlan plan = plan_walk(walk.courtyard, kFrames / kRate_hz, kWalkSpeed_m_s, seed);
    for (const WalkPhase& phase : plan.phases) {
      const std::size_t begin = frame_at(phase.begin_s);
      const std::size_t end = frame_at(phase.end_s());
      if (phase.end_s() > 20.0 || phase.begin_s < 0.1) {
        continue;
      }
      if (phase.is_turn()) {
        const Rigid3 step = poses[begin].inverse() * poses[end];
        EXPECT_NEAR(degrees(step.angle_rad()), 90.0, 20.0) << "seed " << seed;
        EXPECT_NEAR(step.translation.norm(), kArm_m * std::sqrt(2.0), 0.15) << "seed " << seed;
      } else if (phase.is_pause()) {
        EXPECT_LT(way_m(poses, begin, end), 0.12) << "seed " << seed;
      }
    }
    for (const WalkGlance& glance : plan.glances) {
      const std::size_t middle = frame_at(glance.begin_s + glance.turn_s + 0.5 * glance.hold_s);
      if (glance.end_s() < 20.0) {
        EXPECT_NEAR(aside_deg(poses, middle), degrees(glance.angle_rad), 14.0) << "seed " << seed;
        EXPECT_GT(way_m(poses, frame_at(glance.begin_s), frame_at(glance.end_s())), 0.5)
            << "walks on";
      }
    }
  }
}

}  // namespace
}  // namespace stemvo::synth
