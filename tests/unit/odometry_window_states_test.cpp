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

TEST(WindowEstimator, TurningOnTheSpotStaysThere) {
  const std::vector<Rigid3> path =
      path_with(Rigid3(so3_exp({0.0, 2.0 * kDeg, 0.0}), Eigen::Vector3d::Zero()), 10);
  Driven d(DriveTracks(path, points_along(path, 3000, 5), 0.1, 5));
  d.add_range(0, d.drive.num_frames());
  d.expect_only(20, 30, FrameState::kRotating);
  for (int i = 20; i < 30; ++i) {
    EXPECT_LT(d.moved(19, i), 0.01) << i;
  }
  const Rigid3 turn = d.pose(19).inverse() * d.pose(29);
  EXPECT_NEAR(turn.angle_rad(), 20.0 * kDeg, 0.1 * kDeg);
  d.expect_only(31, 50, FrameState::kTracking);
  expect_scale_kept(d, 29);
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

}  // namespace
}  // namespace stemvo
