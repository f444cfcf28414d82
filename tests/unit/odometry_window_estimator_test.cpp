// SPDX-License-Identifier: MIT
#include "support/driven.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

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
  EXPECT_LT(fitted_error_share(since_open(online), since_open(truth)), max_share);
  EXPECT_LT(rotation_error_rad(since_open(online), since_open(truth)), max_rad);
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

TEST(WindowEstimator, ACarAtTenAndAtThirtyFramesASecond) {
  for (const double step_m : {1.0, 1.0 / 3.0}) {
    Driven d(car_drive(60.0, step_m, 0.2, 1));
    d.add_range(0, d.drive.num_frames());
    expect_tracking_since_opening(d);
    expect_accurate(d, 0.01, 0.3 * kDeg);
  }
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
  EXPECT_NEAR(length_ratio(d.estimator.trajectory(), truth, 0, 24) * unit_m, 1.0, 0.02);
  EXPECT_LE(d.pose(24).rotation.angularDistance(truth[24].rotation), 2e-3);
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

TEST(WindowEstimator, AMissingImageWhileInitializingIsNoEnd) {
  Driven d(hand_walk(90, 0.1, 10));
  d.add_range(0, 4);
  EXPECT_EQ(d.run.add_missing().state, FrameState::kNoImage);
  d.add_range(5, 90);
  EXPECT_EQ(d.run.count(FrameState::kLost), 0);
  EXPECT_EQ(d.run.results.back().state, FrameState::kTracking);
}

TEST(WindowEstimator, SaysWhichMapAndWhereItsUnitBegins) {
  Driven d(car_drive(30.0, 0.8, 0.1, 8));
  d.add_range(0, 15);
  d.run.add_matches({}, 15);
  for (int i = 16; i < d.drive.num_frames(); ++i) {
    d.run.add_matches(d.drive.other_matches(i), i);
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
  Driven hand(DriveTracks(path, points_of_room(2500, 4.0, 10), 0.1, 10));
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
