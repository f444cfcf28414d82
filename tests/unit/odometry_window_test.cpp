// SPDX-License-Identifier: MIT
#include "odometry/window.hpp"
#include "odometry/window_estimator.hpp"
#include "odometry/window_history.hpp"
#include "support/estimator_run.hpp"
#include "support/synthetic_drive_tracks.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

void add_keyframe(Window& window, Keyframe keyframe, const WindowOptions& options) {
  if (std::ssize(window.keyframes) >= options.num_keyframes) {
    drop_keyframe(window, leaving_keyframe(window, keyframe), keyframe);
  }
  window.keyframes.push_back(std::move(keyframe));
}

Window window_of(const DriveTracks& drive, const WindowOptions& options) {
  Window window;
  for (std::size_t i = 0; i < drive.world_from_camera.size(); ++i) {
    Keyframe keyframe{static_cast<int>(i), drive.world_from_camera[i], {}};
    for (const auto& [id, uv] : drive.observations[i]) {
      keyframe.points.push_back({id, uv});
    }
    add_keyframe(window, std::move(keyframe), options);
    triangulate_landmarks(window, drive.camera, options);
  }
  return window;
}

/// `i` metres along, turning, with tracks `first_id` to `first_id` + 29.
Rigid3 pose_along(int i) { return {so3_exp({0.0, 0.05 * i, 0.02 * i}), {0.0, 0.1 * i, 1.0 * i}}; }
Keyframe keyframe_along(int i, int first_id) {
  Keyframe keyframe{i, pose_along(i), {}};
  for (int id = first_id; id < first_id + 30; ++id) {
    keyframe.points.push_back({id, {100.0, 100.0}});
  }
  return keyframe;
}

/// Landmarks of all these tracks, so far ahead.
void put_landmarks(Window& window, int num_tracks, double depth_m) {
  for (int id = 0; id < num_tracks; ++id) {
    window.landmarks[id] = {10.0, 0.1 * id, depth_m};
  }
}

TEST(Window, TheOldestKeyframeLeavesOnceFewLandmarksConnectIt) {
  Window window;
  put_landmarks(window, 50, 40.0);
  for (int i = 0; i < 8; ++i) {
    add_keyframe(window, keyframe_along(i, 2 * i), {});
  }
  EXPECT_EQ(leaving_keyframe(window, keyframe_along(8, 11)), 0U);  // 19 in common
  EXPECT_NE(leaving_keyframe(window, keyframe_along(8, 10)), 0U);  // 20
  put_landmarks(window, 50, 400.0);                                // which tell of the turn alone
  EXPECT_EQ(leaving_keyframe(window, keyframe_along(8, 10)), 0U);
}

TEST(Window, OneViewIsKeptFromItsFirstKeyframeOn) {
  Window window;
  put_landmarks(window, 30, 40.0);
  for (int i = 0; i < 30; ++i) {
    add_keyframe(window, keyframe_along(i, 0), {});
  }
  ASSERT_EQ(window.keyframes.size(), 8U);
  EXPECT_EQ(window.keyframes.front().frame, 0);
  for (int i = 0; i < 4; ++i) {  // the last ones stay, as they were seen last
    EXPECT_EQ(window.keyframes[static_cast<std::size_t>(7 - i)].frame, 29 - i);
  }
  for (std::size_t i = 2; i < 4; ++i) {  // the older, the farther apart
    EXPECT_GE(window.keyframes[i - 1].frame - window.keyframes[i - 2].frame,
              window.keyframes[i + 1].frame - window.keyframes[i].frame);
  }
}

TEST(Window, TheWindowForgetsOldKeyframesAndTheirLandmarks) {
  WindowOptions options{.num_keyframes = 5};
  DriveTracks drive(14, 0.0, 1);
  drive.renew_tracks(4, 0);
  drive.renew_tracks(7, 1);
  const Window window = window_of(drive, options);
  ASSERT_EQ(window.keyframes.size(), 5U);
  EXPECT_GT(window.keyframes.front().frame, 0);
  ASSERT_GT(window.landmarks.size(), 100U);
  for (const auto& [id, point] : window.landmarks) {
    EXPECT_LE((point - drive.points[static_cast<std::size_t>(id) % drive.points.size()]).norm(),
              1e-6);
    EXPECT_TRUE(std::ranges::any_of(
        window.keyframes,
        [&](const Keyframe& keyframe) { return find_point(keyframe.points, id) != nullptr; }))
        << "landmark " << id;
  }
}

/// What passes before a camera that stands: by a wrong step of 2 mm it were half a metre away.
TEST(Landmarks, WhatPassesWhileTheCameraStandsIsNone) {
  constexpr int kFirstPassing = 100000;
  const DriveTracks drive(6, 0.0, 2);
  Window window = window_of(drive, {});
  const std::size_t num_landmarks = window.landmarks.size();
  Keyframe& before = window.keyframes.back();
  Keyframe standing{6, before.world_from_camera, before.points};
  standing.world_from_camera.translation.x() += 0.002;
  for (int i = 0; i < 40; ++i) {
    const Eigen::Vector3d point =
        before.world_from_camera * Eigen::Vector3d(-0.2 + 0.01 * i, 0.05, 0.5);
    for (Keyframe* keyframe : {&before, &standing}) {
      keyframe->points.push_back(
          {kFirstPassing + i, drive.camera.project(keyframe->world_from_camera.inverse() * point)});
    }
  }
  add_keyframe(window, standing, {});
  triangulate_landmarks(window, drive.camera, {});
  EXPECT_EQ(window.landmarks.size(), num_landmarks);
  triangulate_landmarks(window, drive.camera, {.min_way_deg = 0.0});
  EXPECT_EQ(window.landmarks.size(), num_landmarks + 40);  // they are as like landmarks as can be
}

TEST(BundleAdjustment, ALandmarkBehindAKeyframeDoesNotStopTheRest) {
  const DriveTracks drive(8, 0.0, 3);
  Window window = window_of(drive, {});
  const int behind = window.landmarks.begin()->first;
  window.landmarks.begin()->second.z() = -5.0;
  window.keyframes.back().world_from_camera.translation.x() += 0.02;
  ASSERT_TRUE(refine_window(window, drive.camera, {}));
  EXPECT_LE((window.keyframes.back().world_from_camera.translation -
             drive.world_from_camera.back().translation)
                .norm(),
            2e-3);
  EXPECT_EQ(window.landmarks.at(behind).z(), -5.0);
}

TEST(Window, KnownLandmarksAreFixedWhereTheyAreSeenAndNoAdjustmentMovesThem) {
  const DriveTracks drive(6, 0.3, 4);
  Window window = window_of(drive, {});
  std::map<int, Eigen::Vector3d> known;
  for (const auto& [id, point] : window.landmarks) {
    known[id] = drive.points[static_cast<std::size_t>(id)];
  }
  const int elsewhere = known.begin()->first;
  known.begin()->second += Eigen::Vector3d(0.0, 5.0, 0.0);
  fix_landmarks(window, drive.camera, known, 2.0);
  EXPECT_FALSE(window.fixed.contains(elsewhere));
  EXPECT_GT(window.fixed.size(), known.size() / 2);
  std::map<int, Eigen::Vector3d> wrong = known;
  for (auto& [id, point] : wrong) {
    point += Eigen::Vector3d(0.0, 0.5, 0.0);
  }
  Window other = window_of(drive, {});
  fix_landmarks(other, drive.camera, wrong, 2.0);
  EXPECT_TRUE(other.fixed.empty());
  EXPECT_TRUE(refine_window(window, drive.camera, {.num_fixed_poses = 1, .camera = std::nullopt}));
  for (const int id : window.fixed) {
    EXPECT_EQ(window.landmarks.at(id), known.at(id));
  }
  move(window, Similarity3(2.0, Eigen::Quaterniond::Identity(), {1.0, 0.0, 0.0}));
  const int id = *window.fixed.begin();
  EXPECT_LT((window.landmarks.at(id) - 2.0 * known.at(id) - Eigen::Vector3d::UnitX()).norm(), 1e-9);
  cull_landmarks(window, drive.camera, {.max_reprojection_error_px = 1e-9});
  EXPECT_TRUE(window.fixed.empty());  // those that are culled
}

TEST(WindowHistory, LandmarksThatHaveLeftAreWhereTheyWere) {
  const DriveTracks drive(40, 0.1, 24);
  WindowEstimator estimator(config_without_scale(), drive.camera);
  EstimatorRun run(estimator, drive);
  for (int i = 0; i < drive.num_frames(); ++i) {
    run.image = cv::Mat(drive.camera.height_px, drive.camera.width_px, CV_8UC3,
                        cv::Scalar(i, 2 * i, 3 * i));
    run.add(i);
  }
  const std::vector<Rigid3>& poses = estimator.trajectory();
  const double unit_m = 1.0 / length_ratio(poses, drive.world_from_camera, 0, 39);
  std::vector<double> errors;
  for (const KeptLandmark& landmark : estimator.landmarks_since(0).landmarks) {
    ASSERT_GE(landmark.frame, 0);
    ASSERT_LT(landmark.frame, drive.num_frames());
    errors.push_back(placing_error(landmark, poses, unit_m, drive));
    EXPECT_GE(landmark.rgb[0], landmark.frame);  // of the last keyframe that saw it
    EXPECT_LT(landmark.rgb[0], landmark.frame + 30);
    EXPECT_EQ(landmark.rgb[2], 3 * landmark.rgb[0]);
  }
  ASSERT_GT(errors.size(), 300U);
  std::ranges::sort(errors);
  EXPECT_LT(errors[errors.size() / 2], 0.01);
  EXPECT_LT(errors[errors.size() * 95 / 100], 0.05);
}

}  // namespace
}  // namespace stemvo
