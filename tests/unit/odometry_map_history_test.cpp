// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "odometry/map_history.hpp"
#include "odometry/two_view_estimator.hpp"
#include "support/map_tracker.hpp"
#include "support/synthetic_drive_tracks.hpp"

namespace stemvo {
namespace {

using testing::DriveTracks;

double distance(const Rigid3& a, const Rigid3& b) { return (a.translation - b.translation).norm(); }

Rigid3 step(double length) { return {so3_exp({0.0, 0.02, 0.0}), {0.0, 0.0, length}}; }

TEST(RefinedPoses, KeyframesFollowTheirMotionsAndTheOthersTheirKeyframe) {
  std::vector<Rigid3> online(1);
  for (int i = 1; i < 6; ++i) {
    online.push_back(online.back() * step(1.0));
  }
  // Frame 2 was no keyframe, frame 5 is after the last one.
  const std::vector<Rigid3> refined = refined_poses(
      online, std::vector<KeyframeMotion>{{0, 1, step(1.1)}, {1, 3, step(2.5)}, {3, 4, step(0.9)}});
  ASSERT_EQ(refined.size(), online.size());
  EXPECT_LT(distance(refined[1], step(1.1)), 1e-12);
  EXPECT_LT(distance(refined[2], step(1.1) * step(1.0)), 1e-12);
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

/// Drives a tracker over frames [from, to); returns the poses as they came.
void drive_on(
    MapTracker& tracker, const DriveTracks& drive, int from, int to, std::vector<Rigid3>& online) {
  const TwoViewEstimator estimator({}, drive.camera);
  for (int i = from; i < to; ++i) {
    const Matches matches = drive.matches(i);
    MeasuredMotion motion = estimator.measure(matches.prev_uv, matches.cur_uv, false, 1);
    testing::add_frame(tracker, i, online.back(), matches, motion);
    online.push_back(tracker.world_from_camera());
  }
}

double rms_step_error(const std::vector<Rigid3>& poses, const DriveTracks& drive) {
  double sum = 0.0;
  for (std::size_t i = 1; i < poses.size(); ++i) {
    const Rigid3 estimated = poses[i - 1].inverse() * poses[i];
    const Rigid3 truth = drive.world_from_camera[i - 1].inverse() * drive.world_from_camera[i];
    sum += (estimated.translation - truth.translation).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(poses.size() - 1));
}

TEST(MapHistory, LookAheadMakesTheStepsBetter) {
  const int num_frames = 40;
  const DriveTracks drive(num_frames, 0.5, 21);
  MapTrackerOptions options;
  options.first_step = drive.world_from_camera[1].translation.norm();
  MapTracker tracker(drive.camera, options);
  std::vector<Rigid3> online(1);
  drive_on(tracker, drive, 1, num_frames, online);
  const std::vector<Rigid3> refined = refined_poses(online, tracker.history().motions());
  ASSERT_EQ(refined.size(), online.size());
  EXPECT_LT(rms_step_error(refined, drive), 0.9 * rms_step_error(online, drive));
  EXPECT_LT(distance(refined.back(), online.back()), 0.5);
}

TEST(MapHistory, RescalingTheWindowDoesNotTearWhatHasLeft) {
  const int num_frames = 30;
  const DriveTracks drive(num_frames, 0.0, 22);
  MapTrackerOptions options;
  options.first_step = drive.world_from_camera[1].translation.norm();
  MapTracker tracker(drive.camera, options);
  std::vector<Rigid3> online(1);
  drive_on(tracker, drive, 1, 20, online);
  tracker.rescale(2.0, online.back().translation);
  drive_on(tracker, drive, 20, num_frames, online);
  const std::vector<Rigid3> refined = refined_poses(online, tracker.history().motions());
  // Steps that had left the window keep their length, the others have the new one.
  const int window = LocalMapOptions{}.num_keyframes;
  for (std::size_t i = 1; i < refined.size(); ++i) {
    const double length = distance(refined[i - 1], refined[i]);
    const double truth = distance(drive.world_from_camera[i - 1], drive.world_from_camera[i]);
    const bool has_left = static_cast<int>(i) <= 20 - window;
    EXPECT_NEAR(length / truth, has_left ? 1.0 : 2.0, 0.02) << i;
  }
}

TEST(MapHistory, LandmarksThatHaveLeftAreWhereTheyWere) {
  const int num_frames = 40;
  const DriveTracks drive(num_frames, 0.1, 24);
  MapTrackerOptions options;
  options.first_step = drive.world_from_camera[1].translation.norm();
  MapTracker tracker(drive.camera, options);
  tracker.keep_landmarks();
  std::vector<Rigid3> online(1);
  cv::Mat picture(drive.camera.height_px, drive.camera.width_px, CV_8UC3);
  const TwoViewEstimator estimator({}, drive.camera);
  for (int i = 1; i < num_frames; ++i) {
    const Matches matches = drive.matches(i);
    MeasuredMotion motion = estimator.measure(matches.prev_uv, matches.cur_uv, false, 1);
    testing::add_frame(tracker, i, online.back(), matches, motion);
    online.push_back(tracker.world_from_camera());
    picture.setTo(cv::Scalar(i, 2 * i, 3 * i));
    tracker.look(picture);
  }
  const MapHistory history = tracker.history();
  const std::vector<Rigid3> refined = refined_poses(online, history.motions());
  std::vector<double> errors;
  for (const MapLandmark& landmark : history.landmarks()) {
    const Eigen::Vector3d place =
        refined[static_cast<std::size_t>(landmark.frame)] * landmark.position.cast<double>();
    double nearest = 1e9;  // landmarks do not tell their number; true points are metres apart
    for (const Eigen::Vector3d& point : drive.points) {
      nearest = std::min(nearest, (point - place).norm());
    }
    errors.push_back(nearest);
    ASSERT_GE(landmark.frame, 1);
    ASSERT_LT(landmark.frame, num_frames);
    EXPECT_EQ(landmark.rgb[0], landmark.frame);  // of the last frame that saw it
    EXPECT_EQ(landmark.rgb[2], 3 * landmark.frame);
  }
  ASSERT_GT(errors.size(), 300U);
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(errors[errors.size() / 2], 0.1);
  EXPECT_LT(errors[errors.size() * 95 / 100], 0.5);
}

TEST(MapHistory, LandmarksAreKeptOnlyWhereTheyAreAskedFor) {
  const DriveTracks drive(20, 0.0, 25);
  MapTracker tracker(drive.camera, {});
  std::vector<Rigid3> online(1);
  drive_on(tracker, drive, 1, 20, online);
  EXPECT_TRUE(tracker.history().landmarks().empty());
}

TEST(MapHistory, APoseTheCallerDidNotTakeIsForgotten) {
  const DriveTracks drive(12, 0.0, 23);
  MapTracker tracker(drive.camera, {});
  std::vector<Rigid3> online(1);
  drive_on(tracker, drive, 1, 8, online);
  online.back() = Rigid3(Eigen::Quaterniond::Identity(), {50.0, 0.0, 0.0});
  drive_on(tracker, drive, 8, 12, online);
  const std::vector<Rigid3> refined = refined_poses(online, tracker.history().motions());
  EXPECT_LT(distance(refined[7], online[7]), 0.5);
  EXPECT_LT(distance(refined[11], online[11]), 0.5);
  tracker.restart(12);
  EXPECT_EQ(tracker.history().motions().size(), 6U + 4U);
}

}  // namespace
}  // namespace stemvo
