// SPDX-License-Identifier: MIT
#include <cmath>

#include <gtest/gtest.h>

#include "odometry/bundle_adjustment.hpp"
#include "odometry/landmarks.hpp"
#include "odometry/reprojection_cost.hpp"
#include "odometry/two_view_estimator.hpp"
#include "support/map_tracker.hpp"
#include "support/synthetic_drive_tracks.hpp"

namespace stemvo {
namespace {

using testing::DriveTracks;

LocalMap map_of(const DriveTracks& drive, const LocalMapOptions& options) {
  LocalMap map;
  for (std::size_t i = 0; i < drive.world_from_camera.size(); ++i) {
    Keyframe keyframe{static_cast<int>(i), drive.world_from_camera[i], {}};
    for (const auto& [id, uv] : drive.observations[i]) {
      keyframe.observations.push_back({id, uv});
    }
    add_keyframe(map, std::move(keyframe), options);
    triangulate_landmarks(map, drive.camera, options);
  }
  return map;
}

TEST(LocalMap, TheWindowForgetsOldKeyframesAndTheirLandmarks) {
  LocalMapOptions options;
  options.num_keyframes = 5;
  const DriveTracks drive(12, 0.0, 1);
  const LocalMap map = map_of(drive, options);
  ASSERT_EQ(map.keyframes.size(), 5U);
  EXPECT_EQ(map.keyframes.front().frame, 7);
  ASSERT_GT(map.landmarks.size(), 100U);
  for (const auto& [id, point] : map.landmarks) {
    EXPECT_LE((point - drive.points[static_cast<std::size_t>(id)]).norm(), 1e-6);
    bool is_seen = false;
    for (const Keyframe& keyframe : map.keyframes) {
      is_seen = is_seen || find_observation(keyframe, id) != nullptr;
    }
    EXPECT_TRUE(is_seen) << "landmark " << id;
  }
}

TEST(Landmarks, WrongPlacesAreCulled) {
  const LocalMapOptions options;
  const DriveTracks drive(6, 0.0, 2);
  LocalMap map = map_of(drive, options);
  const std::size_t num_landmarks = map.landmarks.size();
  map.landmarks.begin()->second += Eigen::Vector3d(3.0, 0.0, 0.0);
  map.landmarks.rbegin()->second.z() = -10.0;
  cull_landmarks(map, drive.camera, options);
  EXPECT_EQ(map.landmarks.size(), num_landmarks - 2);
}

/// At a change of the rotation that is nothing, tiny (the series) and large.
TEST(ReprojectionCost, DerivativesAgreeWithNumericOnes) {
  const Camera camera = testing::kitti_camera();
  const Eigen::Matrix3d rotation = so3_exp({0.1, -0.2, 0.05}).toRotationMatrix();
  const ReprojectionCost cost(camera, rotation, {600.0, 180.0});
  Eigen::Vector3d x(2.0, -1.0, 12.0);
  for (const double size : {0.0, 1e-5, 0.3}) {
    Eigen::Matrix<double, 6, 1> pose;
    pose << size * Eigen::Vector3d(0.5, -0.4, 0.7), 0.3, -0.1, 0.4;
    const double* parameters[] = {pose.data(), x.data()};
    Eigen::Vector2d residual;
    Eigen::Matrix<double, 2, 6, Eigen::RowMajor> by_pose;
    Eigen::Matrix<double, 2, 3, Eigen::RowMajor> by_x;
    double* jacobians[] = {by_pose.data(), by_x.data()};
    ASSERT_TRUE(cost.Evaluate(parameters, residual.data(), jacobians));
    const auto check = [&](double* block, const auto& jacobian) {
      for (int i = 0; i < jacobian.cols(); ++i) {
        const double before = block[i];
        const double step = 1e-6;
        Eigen::Vector2d plus;
        Eigen::Vector2d minus;
        block[i] = before + step;
        ASSERT_TRUE(cost.Evaluate(parameters, plus.data(), nullptr));
        block[i] = before - step;
        ASSERT_TRUE(cost.Evaluate(parameters, minus.data(), nullptr));
        block[i] = before;
        const Eigen::Vector2d numeric = (plus - minus) / (2.0 * step);
        EXPECT_LE((numeric - jacobian.col(i)).norm(), 1e-5 * (1.0 + numeric.norm()))
            << "rotation by " << size << ", parameter " << i;
      }
    };
    check(pose.data(), by_pose);
    check(x.data(), by_x);
  }
}

TEST(ReprojectionCost, APointBehindTheCameraIsRefused) {
  const Camera camera = testing::kitti_camera();
  const Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  const ReprojectionCost cost(camera, rotation, {600.0, 180.0});
  const Eigen::Matrix<double, 6, 1> pose = Eigen::Matrix<double, 6, 1>::Zero();
  const Eigen::Vector3d x(0.0, 0.0, -1.0);
  const double* parameters[] = {pose.data(), x.data()};
  Eigen::Vector2d residual;
  EXPECT_FALSE(cost.Evaluate(parameters, residual.data(), nullptr));
}

TEST(BundleAdjustment, BringsAPushedWindowBackAndKeepsTheGauge) {
  const LocalMapOptions options;
  const DriveTracks drive(8, 0.0, 3);
  LocalMap map = map_of(drive, options);
  for (std::size_t i = 2; i < map.keyframes.size(); ++i) {
    Rigid3& pose = map.keyframes[i].world_from_camera;
    pose = pose * Rigid3(so3_exp({0.001, -0.002, 0.001}), {0.01, -0.02, 0.03});
  }
  BundleAdjustmentOptions refinement;
  refinement.max_iterations = 30;
  const BundleAdjustmentReport report = refine_window(map, drive.camera, refinement);
  ASSERT_TRUE(report.is_usable);
  EXPECT_LT(report.final_cost, 0.01 * report.initial_cost);
  for (std::size_t i = 0; i < map.keyframes.size(); ++i) {
    const Rigid3& truth = drive.world_from_camera[i];
    const Rigid3& pose = map.keyframes[i].world_from_camera;
    EXPECT_LE((pose.translation - truth.translation).norm(), i < 2 ? 1e-12 : 1e-3) << i;
    EXPECT_LE(pose.rotation.angularDistance(truth.rotation), i < 2 ? 1e-7 : 1e-4) << i;
  }
}

TEST(BundleAdjustment, ALandmarkBehindAKeyframeDoesNotStopTheRest) {
  const DriveTracks drive(8, 0.0, 3);
  LocalMap map = map_of(drive, {});
  const int behind = map.landmarks.begin()->first;
  map.landmarks.begin()->second.z() = -5.0;
  map.keyframes.back().world_from_camera.translation.x() += 0.02;
  const BundleAdjustmentReport report = refine_window(map, drive.camera, {});
  ASSERT_TRUE(report.is_usable);
  EXPECT_LT(report.final_cost, 0.1 * report.initial_cost);
  EXPECT_EQ(map.landmarks.at(behind).z(), -5.0);
}

TEST(BundleAdjustment, TooSmallAWindowIsLeftAlone) {
  const DriveTracks drive(2, 0.0, 4);
  LocalMap map = map_of(drive, {});
  EXPECT_FALSE(refine_window(map, drive.camera, {}).is_usable);
  LocalMap empty;
  EXPECT_FALSE(refine_window(empty, drive.camera, {}).is_usable);
}

/// Drives a tracker along; the first step is one unit.
Rigid3 drive_tracker(MapTracker& tracker, const DriveTracks& drive, int from, int to) {
  const TwoViewEstimator estimator({}, drive.camera);
  Rigid3 pose = tracker.world_from_camera();
  for (int i = from; i < to; ++i) {
    const Matches matches = drive.matches(i);
    MeasuredMotion motion = estimator.measure(matches.prev_uv, matches.cur_uv, false, 1);
    testing::add_frame(tracker, i, pose, matches, motion);
    pose = tracker.world_from_camera();
  }
  return pose;
}

TEST(MapTracker, KeepsTheScaleOfItsFirstStep) {
  const int num_frames = 25;
  const DriveTracks drive(num_frames, 0.1, 5, 0.8);
  MapTracker tracker(drive.camera, {});
  const Rigid3 end = drive_tracker(tracker, drive, 1, num_frames);
  const Rigid3& truth = drive.world_from_camera.back();
  const double unit_m = drive.world_from_camera[1].translation.norm();
  EXPECT_NEAR(end.translation.norm() * unit_m / truth.translation.norm(), 1.0, 0.02);
  EXPECT_LE(end.rotation.angularDistance(truth.rotation), 2e-3);
}

TEST(MapTracker, RescalingMultipliesWhatComesAfter) {
  const DriveTracks drive(14, 0.0, 6);
  MapTracker tracker(drive.camera, {});
  const Rigid3 middle = drive_tracker(tracker, drive, 1, 8);
  tracker.rescale(2.0, middle.translation);
  EXPECT_LE((tracker.world_from_camera().translation - middle.translation).norm(), 1e-12);
  const Rigid3 end = drive_tracker(tracker, drive, 8, 14);
  const double true_ratio =
      (drive.world_from_camera[13].translation - drive.world_from_camera[7].translation).norm() /
      drive.world_from_camera[7].translation.norm();
  const double ratio = (end.translation - middle.translation).norm() / middle.translation.norm();
  EXPECT_NEAR(ratio, 2.0 * true_ratio, 0.02);
}

// The caller's pose differs by rounding errors; a step of that size must not become the unit of a
// new map (rendered drive 05 lost its scale at a traffic light).
TEST(MapTracker, StandingStillKeepsMapAndScale) {
  const DriveTracks drive(16, 0.0, 6);
  MapTracker tracker(drive.camera, {});
  Rigid3 pose = drive_tracker(tracker, drive, 1, 9);
  const Rigid3 stop = pose;
  Matches still = drive.matches(8);
  still.prev_uv = still.cur_uv;
  MeasuredMotion motion;
  motion.state = FrameState::kStationary;
  motion.inlier_mask.assign(still.cur_uv.size(), 1);
  for (int i = 0; i < 40; ++i) {
    pose.translation.x() += 1e-15 * (i % 3);
    testing::add_frame(tracker, 9 + i, pose, still, motion);
    pose = tracker.world_from_camera();
  }
  EXPECT_GT(tracker.map().keyframes.size(), 2U);
  const Rigid3 end = drive_tracker(tracker, drive, 9, 16);
  const double true_ratio =
      (drive.world_from_camera[15].translation - drive.world_from_camera[8].translation).norm() /
      drive.world_from_camera[8].translation.norm();
  const double ratio = (end.translation - stop.translation).norm() / stop.translation.norm();
  EXPECT_NEAR(ratio, true_ratio, 0.02);
}

TEST(MapTracker, StartsAnewWhereTheCallerMovedThePose) {
  const DriveTracks drive(12, 0.0, 7);
  MapTracker tracker(drive.camera, {});
  drive_tracker(tracker, drive, 1, 6);
  const TwoViewEstimator estimator({}, drive.camera);
  const Matches matches = drive.matches(6);
  const Rigid3 elsewhere(Eigen::Quaterniond::Identity(), {100.0, 0.0, 0.0});
  MeasuredMotion motion = estimator.measure(matches.prev_uv, matches.cur_uv, false, 1);
  testing::add_frame(tracker, 6, elsewhere, matches, motion);
  EXPECT_EQ(tracker.map().keyframes.size(), 2U);
  EXPECT_LT((tracker.world_from_camera().translation - elsewhere.translation).norm(), 3.0);
}

}  // namespace
}  // namespace stemvo
