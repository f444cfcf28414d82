// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include <gtest/gtest.h>

#include "odometry/window_estimator.hpp"
#include "support/estimator_run.hpp"
#include "support/road_drive.hpp"

namespace stemvo {
namespace {

using testing::DriveTracks;
using testing::EstimatorRun;

constexpr double kDeg = std::numbers::pi / 180.0;

/// A street that winds a little, at a car's speed of `step_m` a frame.
DriveTracks car_drive(double length_m, double step_m, double noise_px, std::uint64_t seed) {
  std::vector<Rigid3> path(1);
  for (double at = step_m; at <= length_m; at += step_m) {
    const double bend = 0.02 * std::sin(0.1 * at);
    path.push_back(path.back() * Rigid3(so3_exp({0.0, bend * step_m, 0.0}),
                                        {0.5 * bend * step_m * step_m, 0.0, step_m}));
  }
  const auto points = testing::points_along(path, static_cast<int>(30.0 * length_m), seed);
  return {path, points, noise_px, seed};
}

/// To and fro before the walls of a room, turning at the same time; 30 frames a second.
DriveTracks hand_walk(int num_frames, double noise_px, std::uint64_t seed) {
  std::vector<Rigid3> path;
  for (int i = 0; i < num_frames; ++i) {
    const double t = i / 30.0;
    const Eigen::Vector3d position(0.6 * std::sin(0.8 * t), 0.02 * std::sin(11.0 * t),
                                   0.3 * (1.0 - std::cos(0.7 * t)));
    path.emplace_back(so3_exp({0.01 * std::sin(5.0 * t), 0.5 * std::sin(0.6 * t), 0.0}), position);
  }
  return {path, testing::points_of_room(2500, 4.0, seed), noise_px, seed};
}

/// An estimator with the defaults that was taken along.
struct Driven {
  DriveTracks drive;
  WindowEstimator estimator{testing::config_without_scale(), drive.camera};
  EstimatorRun run{estimator, drive};
  std::set<int> keyframes;

  explicit Driven(DriveTracks tracks) : drive(std::move(tracks)) {}

  void add_range(int from, int to) {
    for (int i = from; i < to; ++i) {
      run.add(i);
      for (const Keyframe& keyframe : estimator.window().keyframes) {
        keyframes.insert(keyframe.frame);
      }
    }
  }
  [[nodiscard]] const Rigid3& pose(int i) const {
    return estimator.trajectory()[static_cast<std::size_t>(i)];
  }
  [[nodiscard]] double moved(int from, int to) const {
    return (pose(to).translation - pose(from).translation).norm();
  }
  void expect_only(int from, int to, FrameState expected) const {
    for (int i = from; i < to; ++i) {
      EXPECT_EQ(run.state(i), expected) << i << ": " << to_string(run.state(i));
    }
  }
};

/// From the frame that opened the window on, against the truth.
void expect_accurate(const Driven& d, double max_share, double max_rad) {
  const std::vector<Rigid3>& truth = d.drive.world_from_camera;
  const std::vector<Rigid3>& online = d.estimator.trajectory();
  ASSERT_EQ(online.size(), truth.size());
  std::size_t open = 1;
  while (open < online.size() && (online[open].translation - online[0].translation).norm() == 0.0) {
    ++open;
  }
  ASSERT_LT(open, online.size() / 3);
  const auto since_open = [&](const std::vector<Rigid3>& poses) {
    return std::span(poses).subspan(open);
  };
  EXPECT_LT(testing::fitted_error_share(since_open(online), since_open(truth)), max_share);
  EXPECT_LT(testing::rotation_error_rad(since_open(online), since_open(truth)), max_rad);
}

void expect_tracking_since_opening(const Driven& d) {
  bool is_open = false;
  EXPECT_EQ(d.run.state(0), FrameState::kFirst);
  for (int i = 1; i < d.drive.num_frames(); ++i) {
    const FrameState state = d.run.state(i);
    is_open = is_open || state == FrameState::kTracking;
    EXPECT_TRUE(is_open ? state == FrameState::kTracking
                        : state == FrameState::kInitializing || state == FrameState::kLowParallax)
        << i << ": " << to_string(state);
  }
  EXPECT_TRUE(is_open);
}

TEST(WindowEstimator, ACarAtTenFramesASecond) {
  Driven d(car_drive(60.0, 1.0, 0.2, 1));
  d.add_range(0, d.drive.num_frames());
  expect_tracking_since_opening(d);
  expect_accurate(d, 0.01, 0.3 * kDeg);
}

TEST(WindowEstimator, ACarAtThirtyFramesASecond) {
  Driven d(car_drive(60.0, 1.0 / 3.0, 0.2, 1));
  d.add_range(0, d.drive.num_frames());
  expect_tracking_since_opening(d);
  expect_accurate(d, 0.01, 0.3 * kDeg);
}

TEST(WindowEstimator, ACameraInTheHand) {
  Driven d(hand_walk(240, 0.2, 1));
  d.add_range(0, d.drive.num_frames());
  EXPECT_EQ(d.run.count(FrameState::kLost), 0);
  EXPECT_GT(d.run.count(FrameState::kTracking), 190);
  expect_accurate(d, 0.02, 0.5 * kDeg);
}

TEST(WindowEstimator, KeyframesComeByParallaxAndNotByCount) {
  Driven fast(car_drive(24.0, 1.0, 0.1, 2));
  Driven slow(car_drive(24.0, 0.1, 0.1, 2));
  fast.add_range(0, fast.drive.num_frames());
  slow.add_range(0, slow.drive.num_frames());
  const auto per_frame = [](const Driven& d) {
    return static_cast<double>(d.keyframes.size()) / d.drive.num_frames();
  };
  EXPECT_LT(per_frame(slow), 0.4 * per_frame(fast));
  EXPECT_GT(slow.keyframes.size(), 8U);
}

TEST(WindowEstimator, KeepsTheScaleOfItsFirstStep) {
  Driven d(DriveTracks(25, 0.1, 5, 0.8));
  d.add_range(0, 25);
  EXPECT_EQ(d.run.state(1), FrameState::kInitializing);
  EXPECT_NEAR(d.moved(0, 1), 1.0, 1e-9);  // the unit
  const std::vector<Rigid3>& truth = d.drive.world_from_camera;
  const double unit_m = truth[1].translation.norm();
  EXPECT_NEAR(testing::length_ratio(d.estimator.trajectory(), truth, 0, 24) * unit_m, 1.0, 0.02);
  EXPECT_LE(d.pose(24).rotation.angularDistance(truth[24].rotation), 2e-3);
}

/// Drives 20 frames, lets `event` happen for some frames, and drives 20 more.
std::vector<Rigid3> path_with(const Rigid3& event, int num_frames) {
  const Rigid3 step(so3_exp({0.0, 0.003, 0.0}), {0.0, 0.0, 0.8});
  std::vector<Rigid3> path = DriveTracks::repeat(step, 20);
  for (int i = 0; i < num_frames; ++i) {
    path.push_back(path.back() * event);
  }
  for (int i = 0; i < 20; ++i) {
    path.push_back(path.back() * step);
  }
  return path;
}

/// The second drive is as long, in units, as the first: the scale was kept.
void expect_scale_kept(const Driven& d, int event_end) {
  const std::vector<Rigid3>& truth = d.drive.world_from_camera;
  const int last = d.drive.num_frames() - 1;
  const int begin = 5;  // the first frames may have waited for parallax
  EXPECT_NEAR(testing::length_ratio(d.estimator.trajectory(), truth, event_end, last) /
                  testing::length_ratio(d.estimator.trajectory(), truth, begin, 19),
              1.0, 0.02);
}

TEST(WindowEstimator, StationaryKeepsPoseMapAndScale) {
  const std::vector<Rigid3> path = path_with(Rigid3(), 40);
  Driven d(DriveTracks(path, testing::points_along(path, 2000, 4), 0.04, 4));
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
  Driven d(DriveTracks(path, testing::points_along(path, 3000, 5), 0.1, 5));
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
  std::vector<Eigen::Vector3d> points = testing::points_along(path, 3000, 6);
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
  Driven d(DriveTracks(path, testing::points_of_room(500, 4.0, 3), 0.1, 3));
  d.add_range(0, d.drive.num_frames());
  const double unit_m = 1.0 / testing::length_ratio(d.estimator.trajectory(), path, 20, 60);
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
  Driven d(DriveTracks(path, testing::points_of_room(2500, 4.0, 6), 0.05, 6));
  d.run.interval_s = 1.0 / 30.0;
  d.add_range(0, d.drive.num_frames());
  EXPECT_GT(d.run.count(FrameState::kRotating) + d.run.count(FrameState::kStationary) +
                d.run.count(FrameState::kLowParallax),
            100);
  const double unit_m = 1.0 / testing::length_ratio(d.estimator.trajectory(), path, 20, 59);
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
  std::vector<Rigid3> path = DriveTracks::repeat(turn, 45);
  for (int i = 0; i < 20; ++i) {
    path.push_back(path.back() * step);
  }
  std::vector<Eigen::Vector3d> points = testing::points_along(path, 2500, 12);
  const std::vector<Eigen::Vector3d> room = testing::points_of_room(1500, 14.0, 12);
  points.insert(points.end(), room.begin(), room.end());
  Driven d(DriveTracks(path, points, 0.1, 12));
  d.add_range(0, d.drive.num_frames());
  d.expect_only(1, 45, FrameState::kRotating);
  EXPECT_EQ(d.moved(0, 44), 0.0);
  const Rigid3 turned = d.pose(0).inverse() * d.pose(44);
  EXPECT_NEAR(turned.angle_rad(), 110.0 * kDeg, 0.5 * kDeg);
  EXPECT_EQ(d.run.count(FrameState::kLost), 0);
  EXPECT_EQ(d.run.results.back().state, FrameState::kTracking);
  EXPECT_LT(testing::rotation_error_rad(d.estimator.trajectory(), path), 1.0 * kDeg);
}

TEST(WindowEstimator, StandingFromTheStartWaitsForTheDrive) {
  std::vector<Rigid3> path(15);
  const Rigid3 step(so3_exp({0.0, 0.003, 0.0}), {0.0, 0.0, 0.8});
  for (int i = 0; i < 15; ++i) {
    path.push_back(path.back() * step);
  }
  Driven d(DriveTracks(path, testing::points_along(path, 1500, 7), 0.04, 7));
  d.add_range(0, d.drive.num_frames());
  d.expect_only(1, 15, FrameState::kStationary);
  EXPECT_EQ(d.moved(0, 14), 0.0);
  EXPECT_EQ(d.run.state(15), FrameState::kInitializing);
  d.expect_only(17, 30, FrameState::kTracking);
  EXPECT_LT(testing::fitted_error_share(std::span(d.estimator.trajectory()).subspan(15),
                                        std::span(path).subspan(15)),
            0.01);
}

TEST(WindowEstimator, MissingImagesAreBridgedAndTheMapServesOn) {
  Driven d(car_drive(30.0, 0.8, 0.1, 8));
  d.add_range(0, 15);
  const Rigid3 motion = d.pose(13).inverse() * d.pose(14);
  for (int i = 15; i < 17; ++i) {
    EXPECT_EQ(d.run.add_missing().state, FrameState::kNoImage);
    const Rigid3 extrapolated = d.pose(i - 1) * motion;
    EXPECT_LT((d.pose(i).translation - extrapolated.translation).norm(), 1e-9);
  }
  const int oldest = d.estimator.window().keyframes.front().frame;
  d.add_range(17, d.drive.num_frames());
  d.expect_only(17, d.drive.num_frames(), FrameState::kTracking);
  EXPECT_LT(oldest, 15);
  expect_accurate(d, 0.01, 0.3 * kDeg);
}

TEST(WindowEstimator, MissingImagesBeforeTheFirstOneAreNoStart) {
  Driven d(car_drive(10.0, 0.8, 0.1, 9));
  EXPECT_EQ(d.run.add_missing().state, FrameState::kNoImage);
  EXPECT_EQ(d.run.add(0).state, FrameState::kFirst);
  EXPECT_EQ(d.run.add(1).state, FrameState::kInitializing);
  d.add_range(2, 8);
  EXPECT_EQ(d.run.results.back().state, FrameState::kTracking);
  EXPECT_EQ(d.estimator.trajectory().size(), 9U);
}

TEST(WindowEstimator, AMissingImageWhileInitializingIsNoEnd) {
  Driven d(hand_walk(90, 0.1, 10));
  d.add_range(0, 4);
  EXPECT_EQ(d.run.add_missing().state, FrameState::kNoImage);
  d.add_range(5, 90);
  EXPECT_EQ(d.run.count(FrameState::kLost), 0);
  EXPECT_EQ(d.run.results.back().state, FrameState::kTracking);
}

// A cut to another place: the road's scale belonged to the map before.
TEST(WindowEstimator, ALossAndTheNewMapSaySo) {
  const testing::RoadDrive drive(24);
  WindowEstimator estimator(testing::metric_config(), drive.scene.camera);
  EstimatorRun run(estimator, drive.tracks);
  run.road = [&](int i) { return drive.road_image(i, true); };
  run.add_range(0, 10);
  EXPECT_EQ(run.results.back().scale_state, ScaleState::kMeasured);
  const FrameResult lost = run.add_matches({}, 10);
  EXPECT_EQ(lost.state, FrameState::kLost);
  EXPECT_EQ(lost.num_inliers, 0);
  EXPECT_NE(lost.scale_state,
            ScaleState::kMeasured);  // a motion that was not measured measures no road
  EXPECT_GE(lost.scale_sigma.value(), run.results[9].scale_sigma.value());
  bool is_new_map = false;
  for (int i = 11; i < 24; ++i) {
    Matches matches = drive.tracks.matches(i);
    for (int& id : matches.track_ids) {
      id += 100000;
    }
    const FrameResult result = run.add_matches(matches, i);
    EXPECT_NE(result.state, FrameState::kLost) << i;
    if (result.state == FrameState::kInitializing) {  // the old map's scale is not the new one's
      EXPECT_NE(result.scale_state, ScaleState::kHeld) << i;
    }
    if (!is_new_map && result.state == FrameState::kTracking) {
      is_new_map = true;
      EXPECT_EQ(run.results[static_cast<std::size_t>(i) - 1].state, FrameState::kInitializing);
    }
  }
  EXPECT_TRUE(is_new_map);
  EXPECT_EQ(run.results.back().scale_state, ScaleState::kMeasured)
      << run.results.back().road_reason;
  const double step = (run.results[23].world_from_camera.translation -
                       run.results[22].world_from_camera.translation)
                          .norm();
  EXPECT_NEAR(step, testing::RoadDrive::kStep_m, 0.03 * testing::RoadDrive::kStep_m);
}

TEST(WindowEstimator, SaysWhichMapAndWhereItsUnitBegins) {
  Driven d(car_drive(30.0, 0.8, 0.1, 8));
  d.add_range(0, 15);
  d.run.add_matches({}, 15);
  for (int i = 16; i < d.drive.num_frames(); ++i) {
    Matches other = d.drive.matches(i);
    for (int& id : other.track_ids) {
      id += 100000;
    }
    d.run.add_matches(other, i);
  }
  int num_new = 0;
  for (const FrameResult& result : d.run.results) {
    num_new += result.is_scale_new ? 1 : 0;
    EXPECT_EQ(result.map_id, std::max(0, num_new - 1));
    EXPECT_EQ(result.is_measured,
              result.is_scale_new ||
                  (is_measured(result.state) && result.state != FrameState::kInitializing));
  }
  EXPECT_EQ(num_new, 2);
  EXPECT_FALSE(d.run.results[15].is_measured);
}

/// The way of the frames after `before`, in steps of the one before.
std::vector<double> steps_without_images(Driven& d, int before, int count) {
  std::vector<double> steps;
  for (int i = 0; i < count; ++i) {
    d.run.add_missing();
    steps.push_back(d.moved(before + i, before + i + 1) / d.moved(before - 1, before));
  }
  return steps;
}

TEST(WindowEstimator, TheSpeedOfAHandFadesWithinASecondAndThatOfACarLasts) {
  std::vector<Rigid3> path;
  for (int i = 0; i < 160; ++i) {
    path.emplace_back(Eigen::Quaterniond::Identity(),
                      Eigen::Vector3d(0.3 * std::sin(4.0 * i / 30.0), 0.0, 0.0));
  }
  Driven hand(DriveTracks(path, testing::points_of_room(2500, 4.0, 10), 0.1, 10));
  hand.run.interval_s = 1.0 / 30.0;
  hand.add_range(0, 160);
  const std::vector<double> fading = steps_without_images(hand, 159, 60);
  EXPECT_NEAR(fading[3], 1.0, 1e-6);
  EXPECT_LT(fading[31], 1e-6);
  const auto variance = [&](std::size_t i) {
    return hand.run.results[i].motion_covariance.diagonal().head(3).sum();
  };
  EXPECT_GT(variance(219), 2.0 * variance(165));
  Driven car(car_drive(60.0, 0.8, 0.1, 8));
  car.add_range(0, 50);
  for (const double step : steps_without_images(car, 49, 15)) {
    EXPECT_GT(step, 0.9);
    EXPECT_LT(step, 1.01);
  }
  Driven young(car_drive(10.0, 0.8, 0.1, 8));  // nobody knows yet how long its speed lasts
  young.add_range(0, 8);
  EXPECT_LT(steps_without_images(young, 7, 12).back(), 1e-6);
}

TEST(WindowEstimator, TheSameTracksGiveTheSamePoses) {
  Driven a(car_drive(12.0, 0.8, 0.3, 11));
  Driven b(car_drive(12.0, 0.8, 0.3, 11));
  a.add_range(0, a.drive.num_frames());
  b.add_range(0, b.drive.num_frames());
  for (int i = 0; i < a.drive.num_frames(); ++i) {
    EXPECT_EQ(a.pose(i).translation, b.pose(i).translation) << i;
    EXPECT_EQ(a.pose(i).rotation.coeffs(), b.pose(i).rotation.coeffs()) << i;
  }
}

TEST(WindowEstimator, AMissingFrameIsAsFarOnAsItsIntervalIsLong) {
  Driven d(DriveTracks(20, 0.2, 7));
  d.add_range(0, 15);
  const double step = d.moved(13, 14);
  d.run.interval_s = 0.25;
  EXPECT_EQ(d.run.add_missing().state, FrameState::kNoImage);
  EXPECT_NEAR(d.moved(14, 15), 2.5 * step, 0.05 * step);
  const double turn = d.pose(13).rotation.angularDistance(d.pose(14).rotation);
  EXPECT_NEAR(d.pose(14).rotation.angularDistance(d.pose(15).rotation), 2.5 * turn, 0.1 * turn);
}

TEST(WindowEstimator, TheFirstIntervalIsAUnitLongWhateverItLasts) {
  for (const double interval_s : {0.01, 0.1, 20.0}) {
    Driven d(DriveTracks(12, 0.2, 7));
    d.run.interval_s = interval_s;
    d.add_range(0, 12);
    EXPECT_NEAR(d.moved(10, 11), 1.0, 0.1) << interval_s;
  }
}

TEST(WindowEstimator, AHintTurnsAFrameWithoutAnImageOnceHintsWereRight) {
  for (const bool were_right : {true, false}) {
    Driven d(DriveTracks(20, 0.2, 7));
    const Eigen::Quaterniond off = so3_exp({0.0, were_right ? 0.005 : 0.5, 0.0});
    for (int i = 0; i < 15; ++i) {
      if (i > 0) {
        d.run.hints.prev_from_cur =
            (d.drive.pose(i - 1).inverse() * d.drive.pose(i)).rotation * off;
      }
      d.run.add(i);
    }
    d.run.hints.prev_from_cur = so3_exp({0.0, 0.3, 0.0});
    d.run.add_missing();
    const double turn = d.pose(14).rotation.angularDistance(d.pose(15).rotation);
    EXPECT_NEAR(turn, were_right ? 0.3 : 0.0102, 1e-3);
    EXPECT_NEAR(d.moved(14, 15), d.moved(13, 14), 0.05);  // the way goes on
    EXPECT_EQ(d.run.add(15).state, FrameState::kTracking);
    EXPECT_LT(
        d.run.results.back().world_from_camera.rotation.angularDistance(d.drive.pose(15).rotation),
        0.01);
  }
}

}  // namespace
}  // namespace stemvo
