// SPDX-License-Identifier: MIT
// A bad frame must not spoil a window that was fine before.
#include "support/driven.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

constexpr int kBadFrame = 12;

std::vector<Rigid3> path_with_a_jerk(const Rigid3& jerk) {
  const Rigid3 motion(so3_exp({0.0, 0.01, 0.002}), {0.02, 0.0, 1.0});
  const std::vector<Rigid3> before = DriveTracks::repeat(motion, kBadFrame);
  return DriveTracks::go_on(DriveTracks::go_on(before, jerk, 1), motion, 19 - kBadFrame);
}

/// Driven up to kBadFrame.
struct WellDriven : Driven {
  explicit WellDriven(DriveTracks tracks = DriveTracks(20, 0.2, 31)) : Driven(std::move(tracks)) {
    run.add_range(0, kBadFrame);
    EXPECT_EQ(run.results.back().state, FrameState::kTracking);
  }
  [[nodiscard]] double unit_m() const {
    return 1.0 / length_ratio(estimator.trajectory(), drive.world_from_camera, 0, kBadFrame - 1);
  }
  [[nodiscard]] bool keeps_map() const {
    const auto& kept = estimator.window().keyframes;
    return !kept.empty() && kept.front().frame < kBadFrame - 1;
  }
  /// The step to the last frame fed, against that of the drive from `before` to `i`.
  void expect_true_step(int before, int i) const {
    const std::vector<Rigid3>& poses = estimator.trajectory();
    const Rigid3 step = drive.pose(before).inverse() * drive.pose(i);
    const Rigid3 estimate = poses[static_cast<std::size_t>(before)].inverse() * poses.back();
    EXPECT_LT((unit_m() * estimate.translation - step.translation).norm(), 0.05);
    EXPECT_LT(estimate.rotation.angularDistance(step.rotation), 2e-3);
  }
};

TEST(WindowRecovery, AMotionThatNobodyExpectedDoesNotTakeTheMapDown) {
  // To the side, turning the other way.
  const Rigid3 jerk(so3_exp({0.02, -0.15, 0.05}), {0.6, -0.1, 0.3});
  const std::vector<Rigid3> path = path_with_a_jerk(jerk);
  WellDriven d(DriveTracks(path, points_along(path, 1500, 31), 0.2, 31));
  EXPECT_EQ(d.run.add(kBadFrame).state, FrameState::kTracking);
  EXPECT_TRUE(d.keeps_map());
  d.expect_true_step(kBadFrame - 1, kBadFrame);
  EXPECT_EQ(d.run.add(kBadFrame + 1).state, FrameState::kTracking);
  d.expect_true_step(kBadFrame, kBadFrame + 1);
}

TEST(WindowRecovery, ManyWrongTracksAreOutvoted) {
  WellDriven d;
  Matches matches = d.drive.matches(kBadFrame);
  SceneRandom random(5);
  for (std::size_t i = 0; i < matches.cur_uv.size(); ++i) {
    if (matches.track_ids[i] % 10 < 6) {
      matches.cur_uv[i] = random.pixel(d.drive.camera);
    }
  }
  EXPECT_EQ(d.run.add_matches(matches, kBadFrame).state, FrameState::kTracking);
  d.expect_true_step(kBadFrame - 1, kBadFrame);
  int num_kept = 0;
  int num_right = 0;
  int num_wrong_kept = 0;
  for (std::size_t i = 0; i < d.run.inlier_mask.size(); ++i) {
    const bool is_right = d.run.point_ids[i] % 10 >= 6;
    num_right += is_right ? 1 : 0;
    num_kept += is_right && d.run.inlier_mask[i] != 0 ? 1 : 0;
    num_wrong_kept += !is_right && d.run.inlier_mask[i] != 0 ? 1 : 0;
  }
  EXPECT_GT(num_kept, num_right * 95 / 100);
  EXPECT_LT(num_wrong_kept, num_right / 20);  // those near their epipolar lines
}

TEST(WindowRecovery, TracksThatEndAnywhereAreLostAndTheOldMapServesAgain) {
  WellDriven d;
  const std::vector<Rigid3> before = d.estimator.trajectory();
  Matches matches = d.drive.matches(kBadFrame);
  SceneRandom random(6);
  for (Eigen::Vector2d& uv : matches.cur_uv) {
    uv = random.pixel(d.drive.camera);
  }
  const FrameResult lost = d.run.add_matches(matches, kBadFrame);
  EXPECT_EQ(lost.state, FrameState::kLost);
  EXPECT_EQ(lost.num_inliers, 0);
  // The motion goes on as it was.
  d.expect_true_step(kBadFrame - 1, kBadFrame);
}

TEST(WindowRecovery, AfterALossANewMapIsMadeInAUnitOfItsOwn) {
  WellDriven d;
  EXPECT_EQ(d.run.add_matches({}, kBadFrame).state, FrameState::kLost);
  bool was_initializing = false;
  for (int i = kBadFrame + 1; i < 20; ++i) {
    const FrameResult result = d.run.add_matches(d.drive.other_matches(i), i);
    EXPECT_TRUE(result.state == FrameState::kInitializing || result.state == FrameState::kTracking)
        << i << ": " << to_string(result.state);
    was_initializing = was_initializing || result.state == FrameState::kInitializing;
    EXPECT_GT(result.num_inliers, 100) << i;
  }
  EXPECT_TRUE(was_initializing);
  EXPECT_EQ(d.run.results.back().state, FrameState::kTracking);
  EXPECT_GE(d.estimator.window().keyframes.front().frame, kBadFrame);
  // As long as the steps before: the last one measured is the new unit.
  EXPECT_NEAR(
      length_ratio(d.estimator.trajectory(), d.drive.world_from_camera, 18, 19) * d.unit_m(), 1.0,
      0.1);
}

TEST(WindowRecovery, StandingStillAfterALossDoesNotLengthenTheUnit) {
  WellDriven d;
  EXPECT_EQ(d.run.add_matches({}, kBadFrame).state, FrameState::kLost);
  Matches still = d.drive.other_matches(kBadFrame);
  still.prev_uv = still.cur_uv;
  for (int k = 0; k < 40; ++k) {
    EXPECT_EQ(d.run.add_matches(still, kBadFrame).state, FrameState::kStationary) << k;
  }
  for (int i = kBadFrame + 1; i < 20; ++i) {
    d.run.add_matches(d.drive.other_matches(i), i);
  }
  EXPECT_EQ(d.run.results.back().state, FrameState::kTracking);
  const std::vector<Rigid3>& poses = d.estimator.trajectory();
  const double last_step = (poses.back().translation - poses.end()[-2].translation).norm();
  const double true_step = (d.drive.pose(19).translation - d.drive.pose(18).translation).norm();
  EXPECT_NEAR(last_step * d.unit_m() / true_step, 1.0, 0.1);
}

TEST(WindowRecovery, WhereTheLandmarksAreOutOfViewTheMapStartsAnewWithoutAGap) {
  WellDriven d;
  const FrameResult first = d.run.add_matches(d.drive.other_matches(kBadFrame), kBadFrame);
  EXPECT_EQ(first.state, FrameState::kInitializing);
  EXPECT_EQ(d.estimator.window().keyframes.size(), 2U);
  EXPECT_EQ(d.estimator.window().keyframes.front().frame, kBadFrame - 1);
  EXPECT_NEAR(
      (first.world_from_camera.translation - d.estimator.trajectory()[kBadFrame - 1].translation)
              .norm() *
          d.unit_m(),
      1.0, 0.1);  // as long as the step before
  const FrameResult second = d.run.add_matches(d.drive.other_matches(kBadFrame + 1), kBadFrame + 1);
  EXPECT_EQ(second.state, FrameState::kTracking);
  d.expect_true_step(kBadFrame, kBadFrame + 1);
}

/// Mean over the landmarks and the keyframes that see them.
double reprojection_error_px(const Window& window, const Camera& camera) {
  double sum = 0.0;
  int count = 0;
  for (const Keyframe& keyframe : window.keyframes) {
    const Rigid3 camera_from_world = keyframe.world_from_camera.inverse();
    for (const auto& [track_id, point] : window.landmarks) {
      if (const Observation* seen = find_point(keyframe.points, track_id)) {
        sum += (camera.project(camera_from_world * point) - seen->uv).norm();
        ++count;
      }
    }
  }
  return sum / count;
}

TEST(WindowRecovery, ANewMapIsMadeByTheCameraThatWasLearnt) {
  constexpr int kCut = 110;
  const std::vector<Rigid3> path =
      DriveTracks::repeat({so3_exp({0.002, 0.02, 0.0}), {0.0, 0.0, 0.9}}, kCut + 10);
  const Camera truth = kitti_camera();
  const DriveTracks drive(path, points_along(path, 3000, 41), 0.05, 41);
  Camera given = truth;
  given.cx_px += 4.0;
  given.cy_px -= 3.0;
  Options config = config_without_scale();
  config.camera.refine = CameraRefinement::kPrincipalPoint;
  WindowEstimator estimator(config, given);
  EstimatorRun run(estimator, drive);
  run.add_range(0, kCut);
  const Camera learnt = run.results.back().camera;
  ASSERT_NEAR(learnt.cx_px, truth.cx_px, 0.7);
  ASSERT_NEAR(learnt.cy_px, truth.cy_px, 0.7);
  EXPECT_EQ(run.add_matches({}, kCut).state, FrameState::kLost);
  for (int i = kCut + 1; estimator.window().keyframes.front().frame < kCut; ++i) {
    ASSERT_LT(i, drive.num_frames());
    run.add_matches(drive.other_matches(i), i);
  }
  EXPECT_LT(reprojection_error_px(estimator.window(), learnt), 0.2);
  const Keyframe& first = estimator.window().keyframes.front();
  const Keyframe& last = estimator.window().keyframes.back();
  const Eigen::Vector3d travelled =
      (first.world_from_camera.inverse() * last.world_from_camera).translation.normalized();
  const Eigen::Vector3d travelled_in_truth =
      (drive.pose(first.frame).inverse() * drive.pose(last.frame)).translation.normalized();
  EXPECT_LT((travelled - travelled_in_truth).norm(), 3e-3);  // 4 px are 5.5e-3
}

}  // namespace
}  // namespace stemvo
