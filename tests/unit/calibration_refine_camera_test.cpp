// SPDX-License-Identifier: MIT
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "calibration/refine_camera.hpp"
#include "calibration/shared_camera.hpp"
#include "support/synthetic_scene.hpp"

namespace stemvo::calibration {
namespace {

using testing::is_inside;
using testing::kitti_camera;
using testing::SceneRandom;

struct DriveOptions {
  int num_segments = 6;
  double yaw_rad = 0.05;  ///< per keyframe
  double noise_px = 0.03;
  double outlier_ratio = 0.0;
  SharedVector truth = shared_of(kitti_camera());
};

/// Ten keyframes, a metre apart, among points on both sides and the road; pixels by the true
/// camera; poses and points as wrong as an odometry's.
Segment make_segment(const DriveOptions& options, double yaw_rad, SceneRandom& random) {
  const Camera camera = kitti_camera();
  std::vector<Rigid3> world_from_camera(10);
  for (std::size_t k = 1; k < world_from_camera.size(); ++k) {
    world_from_camera[k] =
        world_from_camera[k - 1] * Rigid3(so3_exp({0.0, yaw_rad, 0.0}), {0.01, 0.0, 1.0});
  }
  Segment segment;
  for (const Rigid3& pose : world_from_camera) {
    const Rigid3 wrong(so3_exp(0.002 * random.direction()), 0.02 * random.direction());
    segment.camera_from_first.push_back(segment.camera_from_first.empty() ? Rigid3()
                                                                          : wrong * pose.inverse());
  }
  while (segment.landmarks.size() < 150) {
    const double z = random.uniform(4.0, 60.0);
    const Eigen::Vector3d point(random.uniform(-1.2, 1.2) * z, random.uniform(-4.0, 1.65), z);
    Landmark landmark{(point + 0.01 * z * random.direction()).homogeneous().normalized(), {}};
    for (std::size_t k = 0; k < world_from_camera.size(); ++k) {
      const Eigen::Vector3d x = world_from_camera[k].inverse() * point;
      if (x.z() < 2.0) {
        continue;
      }
      const Eigen::Vector2d uv =
          project_shared<double>(focal_shares(camera), options.truth.data(), x);
      const Eigen::Vector2d noise(random.normal(options.noise_px), random.normal(options.noise_px));
      if (is_inside(camera, uv)) {
        const bool is_outlier = random.uniform(0.0, 1.0) < options.outlier_ratio;
        const Eigen::Vector2d away(random.uniform(1.0, 3.0), random.uniform(-3.0, 3.0));
        landmark.observations.push_back({static_cast<int>(k), is_outlier
                                                                  ? Eigen::Vector2d(uv + away)
                                                                  : Eigen::Vector2d(uv + noise)});
      }
    }
    if (landmark.observations.size() >= 4) {
      segment.landmarks.push_back(landmark);
    }
  }
  return segment;
}

std::vector<Segment> make_drive(const DriveOptions& options, std::uint64_t seed) {
  SceneRandom random(seed);
  std::vector<Segment> segments;
  for (int i = 0; i < options.num_segments; ++i) {
    segments.push_back(
        make_segment(options, i % 2 == 0 ? options.yaw_rad : -options.yaw_rad, random));
  }
  return segments;
}

Camera wrong_camera() {
  SharedVector shared = shared_of(kitti_camera());
  shared.head<3>() += Eigen::Vector3d(0.005 * shared[0], 4.0, -3.0);
  return with_shared(kitti_camera(), shared);
}

TEST(CalibrationRefineCamera, TurnsGiveBackAWrongCamera) {
  const SharedVector truth = shared_of(kitti_camera());
  for (const std::uint64_t seed : {1U, 2U}) {
    const std::vector<Segment> segments = make_drive({}, seed);
    const CalibrationReport refined = refine_camera(segments, wrong_camera(), {});
    EXPECT_NEAR(refined.parameters[0].refined / truth[0], 1.0, 0.001);
    EXPECT_NEAR(refined.parameters[1].refined, truth[1], 0.5);
    EXPECT_NEAR(refined.parameters[2].refined, truth[2], 0.5);
    for (int i = 0; i < kNumShared; ++i) {
      const auto at = static_cast<std::size_t>(i);
      EXPECT_TRUE(refined.parameters[at].is_determined) << i;
      EXPECT_LE(std::abs(refined.parameters[at].refined - truth[i]),
                4.0 * refined.parameters[at].deviation)
          << i;
      EXPECT_GT(refined.parameters[at].deviation, 0.0) << i;
    }
    EXPECT_NEAR(refined.refined_error_px, 0.03, 0.01);
    EXPECT_GT(refined.given_error_px, 1.02 * refined.refined_error_px);
  }
}

TEST(CalibrationRefineCamera, OutliersDoNotPull) {
  DriveOptions options;
  options.outlier_ratio = 0.1;
  const std::vector<Segment> segments = make_drive(options, 4);
  const CalibrationReport refined = refine_camera(segments, wrong_camera(), {});
  EXPECT_NEAR(refined.parameters[0].refined / shared_of(kitti_camera())[0], 1.0, 0.001);
  EXPECT_LT(refined.refined_error_px, 0.04);
}

// Distortion that the model did not have would end up in the focal length.
TEST(CalibrationRefineCamera, DistortionDoesNotMoveTheFocalLength) {
  DriveOptions options;
  options.truth[3] = 0.01;
  options.truth[4] = -0.005;
  const std::vector<Segment> segments = make_drive(options, 5);
  const CalibrationReport refined = refine_camera(segments, wrong_camera(), {});
  EXPECT_NEAR(refined.parameters[0].refined / options.truth[0], 1.0, 0.0015);
  EXPECT_NEAR(refined.parameters[3].refined, 0.01, 0.002);
  EXPECT_NEAR(refined.parameters[4].refined, -0.005, 0.002);
}

TEST(CalibrationRefineCamera, StraightRoadDeterminesNothing) {
  DriveOptions options;
  options.yaw_rad = 0.0;
  const std::vector<Segment> segments = make_drive(options, 6);
  const Camera given = wrong_camera();
  const CalibrationReport refined = refine_camera(segments, given, {});
  EXPECT_FALSE(refined.parameters[0].is_determined);
  EXPECT_EQ(refined.parameters[0].refined, shared_of(given)[0]);
  EXPECT_FALSE(refined.parameters[0].deviation < 0.005 * given.fx_px);
}

TEST(CalibrationRefineCamera, SameInputGivesTheSameBits) {
  const CalibrationReport a = refine_camera(make_drive({}, 7), wrong_camera(), {});
  const CalibrationReport b = refine_camera(make_drive({}, 7), wrong_camera(), {});
  for (std::size_t i = 0; i < a.parameters.size(); ++i) {
    EXPECT_EQ(a.parameters[i].refined, b.parameters[i].refined);
    EXPECT_EQ(a.parameters[i].deviation, b.parameters[i].deviation);
  }
}

TEST(CalibrationRefineCamera, StopsWhenAsked) {
  const std::vector<Segment> segments = make_drive({}, 8);
  int steps = 0;
  const CalibrationReport refined = refine_camera(
      segments, wrong_camera(), [&steps](std::size_t, std::size_t) { return ++steps < 3; });
  EXPECT_TRUE(refined.interrupted);
  EXPECT_EQ(steps, 3);
}

}  // namespace
}  // namespace stemvo::calibration
