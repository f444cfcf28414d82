// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "odometry/window_estimator.hpp"
#include "odometry/window_history.hpp"
#include "support/estimator_run.hpp"

namespace stemvo {
namespace {

using testing::DriveTracks;
using testing::EstimatorRun;

double distance(const Rigid3& a, const Rigid3& b) { return (a.translation - b.translation).norm(); }

Rigid3 step(double length) { return {so3_exp({0.0, 0.02, 0.0}), {0.0, 0.0, length}}; }

/// Poses of frames one metre apart.
std::vector<Rigid3> metre_steps(int num_frames) {
  return DriveTracks::repeat(step(1.0), num_frames);
}

TEST(RefinedPoses, KeyframesFollowTheirMotionsAndTheOthersTheirKeyframe) {
  // Frame 2 was no keyframe, frame 5 is after the last one.
  const std::vector<Rigid3> online = metre_steps(6);
  const std::vector<Rigid3> refined = refined_poses(
      online, std::vector<WindowMotion>{
                  {0, 1, step(1.1)}, {1, 2, step(1.2)}, {1, 3, step(2.5)}, {3, 4, step(0.9)}});
  ASSERT_EQ(refined.size(), online.size());
  EXPECT_LT(distance(refined[1], step(1.1)), 1e-12);
  EXPECT_LT(distance(refined[2], step(1.1) * step(1.2)), 1e-12);
  EXPECT_LT(distance(refined[3], step(1.1) * step(2.5)), 1e-12);
  EXPECT_LT(distance(refined[4], refined[3] * step(0.9)), 1e-12);
  EXPECT_LT(distance(refined[5], refined[4] * step(1.0)), 1e-12);
}

TEST(RefinedPoses, WithoutAMapThePosesStay) {
  const std::vector<Rigid3> online{Rigid3(), step(1.0), step(1.0) * step(0.5)};
  const std::vector<Rigid3> refined = refined_poses(online, {});
  for (std::size_t i = 0; i < online.size(); ++i) {
    EXPECT_LT(distance(refined[i], online[i]), 1e-12);
  }
}

Keyframe keyframe_at(int frame, const Rigid3& pose) {
  return {frame, pose, {{frame, {100.0, 100.0}}}, {{frame + 1, step(0.5)}}};
}

TEST(WindowHistory, WhatHasLeftIsNotRescaledWithTheWindow) {
  Window window;
  window.keyframes.push_back(keyframe_at(0, Rigid3()));
  window.keyframes.push_back(keyframe_at(2, step(1.0)));
  WindowHistory history;
  const Keyframe coming = keyframe_at(4, step(1.0) * step(1.0));
  history.leave(window, 0, coming);
  window.keyframes.pop_front();
  window.keyframes.push_back(coming);
  rescale(window, 3.0, coming.world_from_camera.translation);
  history.close(window);
  const std::vector<WindowMotion>& motions = history.motions();
  ASSERT_EQ(motions.size(), 5U);  // two keyframes, and a non_keyframe of each
  const double lengths[] = {0.5, 1.0, 1.5, 3.0, 1.5};
  for (std::size_t i = 0; i < motions.size(); ++i) {
    EXPECT_NEAR(motions[i].prev_from_cur.translation.norm(), lengths[i], 1e-12) << i;
    EXPECT_EQ(motions[i].cur, static_cast<int>(i) + 1);
  }
}

TEST(WindowHistory, ALandmarkThatHasLeftTheMiddleIsNotRescaledWithTheWindow) {
  Window window;
  WindowHistory history;
  const cv::Mat image(200, 200, CV_8UC1, cv::Scalar(7));
  for (int i = 0; i < 4; ++i) {  // 1 m apart; all see a landmark 4 m from the first
    Keyframe keyframe{i, Rigid3(Eigen::Quaterniond::Identity(), {1.0 * i, 0.0, 0.0}), {}, {}};
    keyframe.points.push_back({7, {100.0, 100.0}});
    window.keyframes.push_back(keyframe);
    window.landmarks[7] = {0.0, 0.0, 4.0};
    history.observe(window, image);
  }
  window.keyframes[0].points.clear();
  window.keyframes[2].points.clear();
  window.keyframes[3].points.clear();
  const Keyframe coming{4, Rigid3(Eigen::Quaterniond::Identity(), {4.0, 0.0, 0.0}), {}, {}};
  history.leave(window, 1, coming);
  ASSERT_EQ(history.landmarks().size(), 1U);
  rescale(window, 2.0, Eigen::Vector3d::Zero());
  history.rescale(window, 2.0, false);
  EXPECT_NEAR(history.landmarks().front().in_camera.z(), 4.0, 1e-6);
  EXPECT_NEAR(history.landmarks().front().in_camera.x(), -1.0, 1e-6);
}

TEST(WindowHistory, LengthsAreThoseOfTheTimeWhenTheFrameCame) {
  Window window;
  WindowHistory history;
  for (int i = 0; i < 24; ++i) {  // from frame 12 on all is found 1.5 times as long
    const Rigid3 last = i == 0 ? step(-1.0) : window.keyframes.back().world_from_camera;
    window.keyframes.push_back({i, last * step(i <= 12 ? 1.0 : 1.5), {}, {}});
    if (i == 12) {
      rescale(window, 1.5, window.keyframes.back().world_from_camera.translation);
      history.rescale(window, 1.5, false);
    }
    history.end_frame();
  }
  history.close(window);
  ASSERT_EQ(history.motions().size(), 23U);
  double last_length = 1.0;
  for (const WindowMotion& motion : history.motions()) {
    const double length = motion.prev_from_cur.translation.norm();
    if (motion.cur <= 6 || motion.cur >= 18) {
      EXPECT_NEAR(length, motion.cur <= 6 ? 1.0 : 1.5, 1e-12) << motion.cur;
    }
    EXPECT_GE(length, last_length - 1e-12) << motion.cur << ": no jump, no wave";
    EXPECT_LE(length, last_length + 0.1) << motion.cur;
    last_length = length;
  }
}

double rms_step_error(const std::vector<Rigid3>& poses, const DriveTracks& drive, double unit_m) {
  double sum = 0.0;
  for (std::size_t i = 1; i < poses.size(); ++i) {
    const Rigid3 estimated = poses[i - 1].inverse() * poses[i];
    const Rigid3 truth = drive.world_from_camera[i - 1].inverse() * drive.world_from_camera[i];
    sum += (unit_m * estimated.translation - truth.translation).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(poses.size() - 1));
}

TEST(WindowHistory, LookAheadMakesTheStepsBetter) {
  const DriveTracks drive(40, 0.5, 21);
  WindowEstimator estimator(testing::config_without_scale(), drive.camera);
  EstimatorRun run(estimator, drive);
  run.add_all();
  const std::vector<Rigid3>& online = estimator.trajectory();
  const std::vector<Rigid3> refined = estimator.map().world_from_camera;
  ASSERT_EQ(refined.size(), online.size());
  const double unit_m = 1.0 / testing::length_ratio(online, drive.world_from_camera, 5, 39);
  EXPECT_LT(rms_step_error(refined, drive, unit_m), 0.9 * rms_step_error(online, drive, unit_m));
  EXPECT_LT(distance(refined.back(), online.back()), 0.5);
}

TEST(WindowHistory, LandmarksThatHaveLeftAreWhereTheyWere) {
  const DriveTracks drive(40, 0.1, 24);
  WindowEstimator estimator(testing::config_without_scale(), drive.camera);
  EstimatorRun run(estimator, drive);
  for (int i = 0; i < drive.num_frames(); ++i) {
    run.image = cv::Mat(drive.camera.height_px, drive.camera.width_px, CV_8UC3,
                        cv::Scalar(i, 2 * i, 3 * i));
    run.add(i);
  }
  const std::vector<Rigid3> refined = estimator.map().world_from_camera;
  const double unit_m = 1.0 / testing::length_ratio(refined, drive.world_from_camera, 0, 39);
  std::vector<double> errors;
  for (const KeptLandmark& landmark : estimator.map().landmarks) {
    ASSERT_GE(landmark.frame, 0);
    ASSERT_LT(landmark.frame, drive.num_frames());
    // In the camera: where the trajectory went is not asked here.
    const Eigen::Vector3d place =
        drive.pose(landmark.frame) * (unit_m * landmark.in_camera.cast<double>());
    double nearest = 1e9;  // landmarks do not tell their number; true points are metres apart
    for (const Eigen::Vector3d& point : drive.points) {
      nearest = std::min(nearest, (point - place).norm());
    }
    errors.push_back(nearest);
    EXPECT_GE(landmark.rgb[0], landmark.frame);  // of the last keyframe that saw it
    EXPECT_LT(landmark.rgb[0], landmark.frame + 30);
    EXPECT_EQ(landmark.rgb[2], 3 * landmark.rgb[0]);
  }
  ASSERT_GT(errors.size(), 300U);
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(errors[errors.size() / 2], 0.1);
  EXPECT_LT(errors[errors.size() * 95 / 100], 0.5);
}

}  // namespace
}  // namespace stemvo
