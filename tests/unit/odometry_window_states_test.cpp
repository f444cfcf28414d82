// SPDX-License-Identifier: MIT
#include "support/driven.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

/// Drives 20 frames, lets `event` happen for some frames, and drives 20 more.
std::vector<Rigid3> path_with(const Rigid3& event, int num_frames) {
  const Rigid3 step(so3_exp({0.0, 0.003, 0.0}), {0.0, 0.0, 0.8});
  return DriveTracks::go_on(DriveTracks::go_on(DriveTracks::repeat(step, 20), event, num_frames),
                            step, 20);
}

/// The second drive is as long, in units, as the first: the scale was kept.
void expect_scale_kept(const Driven& d, int event_end) {
  const std::vector<Rigid3>& truth = d.drive.world_from_camera;
  const int last = d.drive.num_frames() - 1;
  const int begin = 5;  // the first frames may have waited for parallax
  EXPECT_NEAR(length_ratio(d.estimator.trajectory(), truth, event_end, last) /
                  length_ratio(d.estimator.trajectory(), truth, begin, 19),
              1.0, 0.02);
}

TEST(WindowEstimator, StationaryKeepsPoseMapAndScale) {
  const std::vector<Rigid3> path = path_with(Rigid3(), 40);
  Driven d(DriveTracks(path, points_along(path, 2000, 4), 0.04, 4));
  d.add_range(0, 20);
  const int oldest = d.estimator.window().keyframes.front().frame;
  const std::size_t num_landmarks = d.estimator.window().landmarks.size();
  d.add_range(20, 60);
  d.expect_only(20, 60, FrameState::kStationary);
  for (int i = 20; i < 60; ++i) {  // the nearest points are 4 units away
    EXPECT_LT(d.moved(19, i), 2e-3) << i;
    EXPECT_LT(d.pose(i).rotation.angularDistance(d.pose(19).rotation), 5e-5) << i;
  }
  EXPECT_EQ(d.estimator.window().keyframes.front().frame, oldest);
  EXPECT_EQ(d.estimator.window().landmarks.size(), num_landmarks);
  d.add_range(60, 80);
  d.expect_only(60, 80, FrameState::kTracking);
  expect_scale_kept(d, 59);
}

/// What passes hides the landmarks: tracks begun meanwhile say how the camera moves off, the few
/// landmarks left how far.
TEST(WindowEstimator, MovingOffKeepsTheUnitWithFewOldLandmarks) {
  const Rigid3 step(so3_exp({0.0, 0.003, 0.0}), {0.0, 0.0, 0.8});
  const Rigid3 slower(step.rotation, 0.5 * step.translation);
  const std::vector<Rigid3> path = DriveTracks::go_on(
      DriveTracks::go_on(DriveTracks::repeat(step, 20), Rigid3(), 40), slower, 20);
  DriveTracks drive(path, points_along(path, 2000, 4), 0.1, 4);
  for (int i = 1; i < 60; ++i) {
    drive.renew_tracks(i < 30 ? 30 : 40, i, 60);
  }
  for (int i = 60; i < 300; i += 60) {  // seven are left in the second frame that moves
    drive.renew_tracks(61, i, 300);
  }
  Driven d(std::move(drive));
  d.add_range(0, 80);
  d.expect_only(60, 80, FrameState::kTracking);
  expect_scale_kept(d, 59);
}

/// A lorry hides all landmarks and most of the image. What is seen beside it and does not move says
/// that the camera still stands, although what was seen before it came is hidden by and by.
TEST(WindowEstimator, WhoStandsBehindALorryStays) {
  const Rigid3 step(so3_exp({0.0, 0.003, 0.0}), {0.0, 0.0, 0.8});
  const std::vector<Rigid3> path = DriveTracks::go_on(DriveTracks::repeat(step, 20), Rigid3(), 40);
  DriveTracks drive(path, points_along(path, 2000, 4), 0.04, 4);
  for (int i = 0; i < 8; ++i) {
    drive.renew_tracks(22 + i, i, 8);
  }
  for (int i = 30; i < 60; ++i) {
    auto& seen = drive.observations[static_cast<std::size_t>(i)];
    std::erase_if(seen, [&](const auto& one) { return one.second.x() > 250.0; });
    const auto beside = std::exchange(seen, {});
    for (const auto& [id, uv] : beside) {
      seen.emplace(id + 10000 * ((i - 30 - id % 8) / 8), uv);
    }
    for (int k = 0; k < 300; ++k) {
      const Eigen::Vector2d place(250.0 + 40.0 * (k % 30) + 12.0 * (i - 30),
                                  30.0 + 30.0 * (k / 30));
      if (place.x() < drive.camera.width_px) {
        seen.emplace(100000 + k, place);
      }
    }
  }
  Driven d(std::move(drive));
  d.add_range(0, 60);
  d.expect_only(21, 60, FrameState::kStationary);
  for (int i = 21; i < 60; ++i) {
    EXPECT_LT(d.moved(19, i), 2e-3) << i;
  }
}

/// Behind a bend only what is infinitely far is seen: the camera goes on as it was seen to,
/// unmeasured.
TEST(WindowEstimator, WithoutAMapAndParallaxThePositionGoesOn) {
  const Rigid3 step(so3_exp({0.0, 0.003, 0.0}), {0.0, 0.0, 0.8});
  const std::vector<Rigid3> path = DriveTracks::repeat(step, 30);
  DriveTracks drive(path, points_along(path, 2000, 4), 0.04, 4);
  for (int i = 20; i < 30; ++i) {
    auto& seen = drive.observations[static_cast<std::size_t>(i)];
    seen.clear();
    for (int k = 0; k < 300; ++k) {
      const Eigen::Vector3d far(0.1 * (k % 20 - 10), 0.02 * (k / 20 - 8), 1.0);
      const Eigen::Vector3d here =
          drive.pose(i).rotation.conjugate() * (drive.pose(20).rotation * far);
      seen.emplace(100000 + k, drive.camera.project(here));
    }
  }
  Driven d(std::move(drive));
  d.add_range(0, 30);
  d.expect_only(23, 30, FrameState::kRotating);
  for (int i = 21; i < 30; ++i) {
    EXPECT_FALSE(d.run.results[static_cast<std::size_t>(i)].is_measured) << i;
    EXPECT_NEAR(d.moved(i - 1, i) / d.moved(18, 19), 1.0, 0.2) << i;
  }
}

TEST(WindowEstimator, ATurnThatLosesEveryLandmarkFromViewStaysWhereItIs) {
  const std::vector<Rigid3> path =
      path_with(Rigid3(so3_exp({0.0, 2.5 * kDeg, 0.0}), Eigen::Vector3d::Zero()), 44);
  std::vector<Eigen::Vector3d> points = points_along(path, 3000, 6);
  Driven d(DriveTracks(path, points, 0.1, 6));
  d.add_range(0, d.drive.num_frames());
  d.expect_only(20, 64, FrameState::kRotating);
  EXPECT_LT(d.moved(19, 63), 0.03);
  const Rigid3 turn = d.pose(19).inverse() * d.pose(63);
  EXPECT_NEAR(turn.angle_rad(), 110.0 * kDeg, 0.5 * kDeg);
  EXPECT_EQ(d.run.results.back().state, FrameState::kTracking);
  EXPECT_EQ(d.run.count(FrameState::kLost), 0);
}

/// Standing for a minute before a room whose walls are 4 m away, with the noise of a real tracker.
TEST(WindowEstimator, ACameraThatStandsDoesNotDrift) {
  std::vector<Rigid3> path;
  for (int i = 0; i < 1860; ++i) {
    const double t = std::min(i, 60) / 30.0;
    path.emplace_back(Eigen::Quaterniond::Identity(),
                      Eigen::Vector3d(0.3 * (1.0 - std::cos(t)), 0.0, 0.3 * t));
  }
  Driven d(DriveTracks(path, points_of_room(500, 4.0, 3), 0.1, 3));
  d.add_range(0, d.drive.num_frames());
  const double unit_m = 1.0 / length_ratio(d.estimator.trajectory(), path, 20, 60);
  for (int i = 70; i < d.drive.num_frames(); ++i) {
    EXPECT_LT(unit_m * d.moved(65, i), 0.004) << i;  // 1 mm of a metre
  }
}

/// A hand that hardly moves: the images say little, but no position is held.
TEST(WindowEstimator, ASlowHandIsFollowedWithoutAJump) {
  std::vector<Rigid3> path;
  double x = 0.0;
  for (int i = 0; i < 300; ++i) {
    x += i < 60 ? 0.02 : 0.001 * (1.0 + std::sin(0.05 * i));  // 0.1 px a frame
    path.emplace_back(so3_exp({0.0, 0.002 * i, 0.0}), Eigen::Vector3d(x, 0.0, 0.0));
  }
  Driven d(DriveTracks(path, points_of_room(2500, 4.0, 6), 0.05, 6));
  d.run.interval_s = 1.0 / 30.0;
  d.add_range(0, d.drive.num_frames());
  EXPECT_GT(d.run.count(FrameState::kRotating) + d.run.count(FrameState::kStationary) +
                d.run.count(FrameState::kLowParallax),
            100);
  const double unit_m = 1.0 / length_ratio(d.estimator.trajectory(), path, 20, 59);
  for (int i = 70; i < d.drive.num_frames(); ++i) {
    EXPECT_GT(d.moved(i - 1, i), 0.0) << i;
    EXPECT_LT(unit_m * d.moved(i - 1, i), 0.006) << i;
  }
  EXPECT_NEAR(unit_m * d.moved(80, 299), path[299].translation.x() - path[80].translation.x(),
              0.02);
}

// A turn from the first frame on: nothing of it is in view in the end.
TEST(WindowEstimator, AReferenceThatIsWornOutIsRenewed) {
  const Rigid3 turn(so3_exp({0.0, 2.5 * kDeg, 0.0}), Eigen::Vector3d::Zero());
  const Rigid3 step(so3_exp({0.0, 0.003, 0.0}), {0.0, 0.0, 0.4});
  const std::vector<Rigid3> path = DriveTracks::go_on(DriveTracks::repeat(turn, 45), step, 20);
  std::vector<Eigen::Vector3d> points = points_along(path, 2500, 12);
  const std::vector<Eigen::Vector3d> room = points_of_room(1500, 14.0, 12);
  points.insert(points.end(), room.begin(), room.end());
  Driven d(DriveTracks(path, points, 0.1, 12));
  d.add_range(0, d.drive.num_frames());
  d.expect_only(1, 45, FrameState::kRotating);
  EXPECT_EQ(d.moved(0, 44), 0.0);
  const Rigid3 turned = d.pose(0).inverse() * d.pose(44);
  EXPECT_NEAR(turned.angle_rad(), 110.0 * kDeg, 0.5 * kDeg);
  EXPECT_EQ(d.run.count(FrameState::kLost), 0);
  EXPECT_EQ(d.run.results.back().state, FrameState::kTracking);
  EXPECT_LT(rotation_error_rad(d.estimator.trajectory(), path), 1.0 * kDeg);
}

TEST(WindowEstimator, StandingFromTheStartWaitsForTheDrive) {
  const Rigid3 step(so3_exp({0.0, 0.003, 0.0}), {0.0, 0.0, 0.8});
  const std::vector<Rigid3> path = DriveTracks::go_on(std::vector<Rigid3>(15), step, 15);
  Driven d(DriveTracks(path, points_along(path, 1500, 7), 0.04, 7));
  d.add_range(0, d.drive.num_frames());
  d.expect_only(1, 15, FrameState::kStationary);
  EXPECT_EQ(d.moved(0, 14), 0.0);
  EXPECT_EQ(d.run.state(15), FrameState::kInitializing);
  d.expect_only(17, 30, FrameState::kTracking);
  EXPECT_LT(fitted_error_share(std::span(d.estimator.trajectory()).subspan(15),
                               std::span(path).subspan(15)),
            0.01);
}

constexpr int kBadFrame = 12;

std::vector<Rigid3> path_with_a_jerk(const Rigid3& jerk) {
  const Rigid3 motion(so3_exp({0.0, 0.01, 0.002}), {0.02, 0.0, 1.0});
  const std::vector<Rigid3> before = DriveTracks::repeat(motion, kBadFrame);
  return DriveTracks::go_on(DriveTracks::go_on(before, jerk, 1), motion, 19 - kBadFrame);
}

/// Driven up to kBadFrame: a bad frame must not spoil a window that was fine before.
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

TEST(WindowRecovery, TheImageAsAWholeTurnsACameraThatIsLost) {
  WellDriven d;
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitY()));
  d.run.image_turn = turn;
  EXPECT_EQ(d.run.add_matches({}, kBadFrame).state, FrameState::kLost);
  const std::vector<Rigid3>& poses = d.estimator.trajectory();
  const Rigid3 step = poses.end()[-2].inverse() * poses.back();
  EXPECT_LT(step.rotation.angularDistance(turn), 1e-9);
  EXPECT_GT(step.translation.norm(), 0.0);
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
