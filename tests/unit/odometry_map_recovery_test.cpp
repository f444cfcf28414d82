// SPDX-License-Identifier: MIT
#include <algorithm>

#include <gtest/gtest.h>

#include "odometry/two_view_estimator.hpp"
#include "support/map_tracker.hpp"
#include "support/synthetic_drive_tracks.hpp"

namespace stemvo {
namespace {

using testing::DriveTracks;

constexpr int kBadFrame = 12;

/// A tracker that knows the true length of the first step, driven up to kBadFrame.
struct Driven {
  DriveTracks drive{20, 0.2, 31};
  TwoViewEstimator estimator{{}, drive.camera};
  MapTracker tracker{drive.camera, options()};
  Rigid3 pose;

  Driven() {
    for (int i = 1; i < kBadFrame; ++i) {
      go_on(i);
    }
  }
  [[nodiscard]] MapTrackerOptions options() const {
    MapTrackerOptions result;
    result.first_step = drive.world_from_camera[1].translation.norm();
    return result;
  }
  [[nodiscard]] MeasuredMotion measure(const Matches& matches) const {
    return estimator.measure(matches.prev_uv, matches.cur_uv, false, 1);
  }
  void go_on(int i) {
    const Matches matches = drive.matches(i);
    MeasuredMotion motion = measure(matches);
    ASSERT_TRUE(testing::add_frame(tracker, i, pose, matches, motion)) << i;
    EXPECT_TRUE(tracker.keeps_unit()) << i;
    pose = tracker.world_from_camera();
  }
  void expect_true_step(int i) const {
    const Rigid3 step = drive.world_from_camera[static_cast<std::size_t>(i) - 1].inverse() *
                        drive.world_from_camera[static_cast<std::size_t>(i)];
    const Rigid3 estimate = pose.inverse() * tracker.world_from_camera();
    EXPECT_LT((estimate.translation - step.translation).norm(), 0.05);
    EXPECT_LT(estimate.rotation.angularDistance(step.rotation), 2e-3);
  }
};

TEST(MapRecovery, AWrongTwoFrameMotionDoesNotTakeTheMapDown) {
  Driven d;
  const Matches matches = d.drive.matches(kBadFrame);
  MeasuredMotion motion = d.measure(matches);
  const MeasuredMotion right = motion;
  // To the side, turning the wrong way, and believed by a quarter of the matches.
  motion.cur_from_prev = Rigid3(so3_exp({0.0, 0.15, 0.05}), Eigen::Vector3d::UnitX());
  for (std::size_t i = 0; i < motion.inlier_mask.size(); ++i) {
    motion.inlier_mask[i] = i % 4 == 0 ? 1 : 0;
  }
  motion.num_inliers = right.num_inliers / 4;
  ASSERT_TRUE(testing::add_frame(d.tracker, kBadFrame, d.pose, matches, motion));
  EXPECT_TRUE(d.tracker.keeps_unit());
  d.expect_true_step(kBadFrame);
  EXPECT_EQ(motion.state, FrameState::kTracking);
  EXPECT_GT(motion.num_inliers, right.num_inliers * 8 / 10);
  EXPECT_LT((motion.cur_from_prev.translation - right.cur_from_prev.translation).norm(), 0.05);
  d.pose = d.tracker.world_from_camera();
  d.go_on(kBadFrame + 1);
}

TEST(MapRecovery, ALostTwoFrameMotionIsFoundAmongTheLandmarks) {
  Driven d;
  const Matches matches = d.drive.matches(kBadFrame);
  MeasuredMotion motion;
  motion.inlier_mask.assign(matches.cur_uv.size(), 0);
  ASSERT_EQ(motion.state, FrameState::kLost);
  ASSERT_TRUE(testing::add_frame(d.tracker, kBadFrame, d.pose, matches, motion));
  EXPECT_EQ(motion.state, FrameState::kTracking);
  d.expect_true_step(kBadFrame);
}

TEST(MapRecovery, ManyWrongTracksAreOutvoted) {
  Driven d;
  Matches matches = d.drive.matches(kBadFrame);
  testing::SceneRandom random(5);
  for (std::size_t i = 0; i < matches.cur_uv.size(); ++i) {
    if (i % 10 < 6) {
      matches.cur_uv[i] = random.pixel(d.drive.camera);
    }
  }
  MeasuredMotion motion;
  motion.inlier_mask.assign(matches.cur_uv.size(), 0);
  ASSERT_TRUE(testing::add_frame(d.tracker, kBadFrame, d.pose, matches, motion));
  d.expect_true_step(kBadFrame);
  for (std::size_t i = 0; i < matches.cur_uv.size(); ++i) {
    if (i % 10 >= 6) {
      EXPECT_EQ(motion.inlier_mask[i], 1) << i;
    }
  }
}

TEST(MapRecovery, TracksThatEndAnywhereAreLostWhateverTheMotionSays) {
  Driven d;
  Matches matches = d.drive.matches(kBadFrame);
  testing::SceneRandom random(6);
  for (Eigen::Vector2d& uv : matches.cur_uv) {
    uv = random.pixel(d.drive.camera);
  }
  MeasuredMotion motion;  // as two frames may see it: a direction that some matches agree on
  motion.state = FrameState::kTracking;
  motion.cur_from_prev.translation = -Eigen::Vector3d::UnitZ();
  motion.inlier_mask =
      epipolar_inliers(motion.cur_from_prev, matches.prev_uv, matches.cur_uv, d.drive.camera, 5.0);
  motion.num_inliers =
      static_cast<int>(std::count(motion.inlier_mask.begin(), motion.inlier_mask.end(), char{1}));
  EXPECT_FALSE(testing::add_frame(d.tracker, kBadFrame, d.pose, matches, motion));
  EXPECT_EQ(motion.state, FrameState::kLost);
  d.tracker.restart(kBadFrame);
  EXPECT_TRUE(d.tracker.map().keyframes.empty());
  d.go_on(kBadFrame + 1);
  EXPECT_EQ(d.tracker.map().keyframes.size(), 2U);
}

TEST(MapRecovery, WhereTheLandmarksAreOutOfViewTheMapStartsAnewInAUnitOfItsOwn) {
  Driven d;
  Matches matches = d.drive.matches(kBadFrame);
  for (int& id : matches.track_ids) {
    id += 100000;  // the same views of other things
  }
  MeasuredMotion motion = d.measure(matches);
  ASSERT_TRUE(testing::add_frame(d.tracker, kBadFrame, d.pose, matches, motion));
  EXPECT_FALSE(d.tracker.keeps_unit());
  EXPECT_EQ(d.tracker.map().keyframes.size(), 2U);
  EXPECT_NEAR((d.tracker.world_from_camera().translation - d.pose.translation).norm(),
              d.options().first_step, 0.1);  // as long as the step before
  d.pose = d.tracker.world_from_camera();
  matches = d.drive.matches(kBadFrame + 1);
  for (int& id : matches.track_ids) {
    id += 100000;
  }
  motion = d.measure(matches);
  ASSERT_TRUE(testing::add_frame(d.tracker, kBadFrame + 1, d.pose, matches, motion));
  EXPECT_TRUE(d.tracker.keeps_unit());
  d.expect_true_step(kBadFrame + 1);
}

}  // namespace
}  // namespace stemvo
