// SPDX-License-Identifier: MIT
#include "odometry/moving_things.hpp"
#include "odometry/tracks.hpp"
#include "odometry/window_estimator.hpp"
#include "support/estimator_run.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

/// A street that winds a little, 0.8 m a frame.
DriveTracks street(int num_frames, std::uint64_t seed) {
  std::vector<Rigid3> path(1);
  while (static_cast<int>(path.size()) < num_frames) {
    const double bend = 0.016 * std::sin(0.08 * static_cast<double>(path.size()));
    path.push_back(path.back() * Rigid3(so3_exp({0.0, bend, 0.0}), {0.5 * bend, 0.0, 0.8}));
  }
  return {path, points_along(path, 18 * num_frames, seed), 0.1, seed};
}

/// A plane full of corners before this part of the image, which it crosses at `px_per_frame`; what
/// leaves it on one side comes in on the other as another track. It comes with a frame.
void put_plane_before(
    DriveTracks& drive, double from, double to, double px_per_frame, int first_frame = 0) {
  constexpr int kNumCorners = 150;
  const double left = from * drive.camera.width_px;
  const double width = (to - from) * drive.camera.width_px;
  SceneRandom random(5);
  std::vector<Eigen::Vector2d> corners;
  for (int i = 0; i < kNumCorners; ++i) {
    corners.emplace_back(random.uniform(0.0, width), random.uniform(5.0, 370.0));
  }
  for (int frame = first_frame; frame < drive.num_frames(); ++frame) {
    auto& seen = drive.observations[static_cast<std::size_t>(frame)];
    std::erase_if(seen, [&](const auto& point) {
      return point.second.x() >= left && point.second.x() < left + width;
    });
    for (int i = 0; i < kNumCorners; ++i) {
      const Eigen::Vector2d& corner = corners[static_cast<std::size_t>(i)];
      const double at = corner.x() + px_per_frame * frame;
      const int lap = static_cast<int>(at / width);
      const Eigen::Vector2d noise = random.noise(0.1);
      seen.emplace(100000 + 1000 * lap + i,
                   Eigen::Vector2d(left + at - lap * width, corner.y()) + noise);
    }
  }
}

/// Tracked but for so many frames; rotation, and shape of the path, once a map is open.
void expect_true_path(const DriveTracks& drive, int max_untracked) {
  WindowEstimator estimator(config_without_scale(), drive.camera);
  EstimatorRun run(estimator, drive);
  run.add_all();
  EXPECT_GT(run.count(FrameState::kTracking), drive.num_frames() - max_untracked);
  constexpr double kMax_rad = 0.02;
  const std::vector<Rigid3>& found = estimator.trajectory();
  const std::size_t open = 2;
  const Rigid3 truth = drive.world_from_camera[open].inverse() * drive.world_from_camera.back();
  const Rigid3 estimate = found[open].inverse() * found.back();
  EXPECT_LT(estimate.rotation.angularDistance(truth.rotation), kMax_rad);
  EXPECT_LT((estimate.translation.normalized() - truth.translation.normalized()).norm(), kMax_rad);
}

TEST(MovingThings, ThePathIsTheWorldsFromTheFirstFrameOn) {
  for (const double px_per_frame : {2.0, 5.0, 10.0}) {
    SCOPED_TRACE(px_per_frame);
    DriveTracks drive = street(40, 3);
    put_plane_before(drive, 0.333, 0.667, px_per_frame);
    expect_true_path(drive, 6);
  }
}

TEST(MovingThings, FarPointsThatMoveNearlyAsAThingDoesAreTheWorlds) {
  const Camera camera = street(2, 3).camera;
  const Rigid3 cur_from_prev(so3_exp({0.0, 2.5 / camera.fx_px, 0.0}), {0.0, 0.0, -0.8});
  constexpr int kNumFar = 60;
  constexpr int kNumOfThing = 150;
  SceneRandom random(4);
  std::vector<Eigen::Vector2d> prev;
  std::vector<Eigen::Vector2d> cur;
  const auto add = [&](const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
    prev.push_back(from + random.noise(0.1));
    cur.push_back(to + random.noise(0.1));
  };
  for (int i = 0; i < 130; ++i) {
    const double side = (i % 2 == 0 ? 0.0 : 0.67) + random.uniform(0.0, 0.33);
    const Eigen::Vector2d uv(side * camera.width_px, random.uniform(5.0, 370.0));
    const double depth = i < kNumFar ? random.uniform(150.0, 400.0) : random.uniform(6.0, 30.0);
    add(uv, camera.project(cur_from_prev * (depth * camera.normalize(uv).homogeneous())));
  }
  for (int i = 0; i < kNumOfThing; ++i) {
    const Eigen::Vector2d uv(random.uniform(0.34, 0.66) * camera.width_px,
                             random.uniform(5.0, 370.0));
    add(uv, uv + Eigen::Vector2d(5.0, 0.0));
  }
  const MeasuredMotion world =
      Initializer(config_without_scale()).measure_world({prev, cur}, camera);
  // All of them, were a thing's points those within the bound of everything else.
  EXPECT_LT(std::count(world.moving_mask.begin(), world.moving_mask.begin() + kNumFar, char{1}),
            kNumFar * 2 / 3);
  EXPECT_GT(std::count(world.moving_mask.end() - kNumOfThing, world.moving_mask.end(), char{1}),
            140);
  const double off_rad = world.cur_from_prev.rotation.angularDistance(cur_from_prev.rotation);
  EXPECT_LT(camera.fx_px * off_rad, 0.5);
}

/// A road that turns by so much a frame from frame 20 on, behind a lorry that came at frame 8.
void expect_true_path_behind_lorry(double turn_rad) {
  std::vector<Rigid3> path(1);
  for (int i = 1; i < 60; ++i) {
    const double bend = std::clamp(0.0015 * (i - 20), 0.0, turn_rad);
    path.push_back(path.back() * Rigid3(so3_exp({0.0, bend, 0.0}), {0.5 * bend, 0.0, 0.8}));
  }
  DriveTracks drive(path, points_along(path, 400, 3), 0.1, 3);
  put_plane_before(drive, 0.3, 0.72, 0.0, 8);
  expect_true_path(drive, 6);
}

TEST(MovingThings, ALorryAheadAtOneDistanceDoesNotHoldTheRotation) {
  expect_true_path_behind_lorry(0.02);
  expect_true_path_behind_lorry(0.0025);  // less than a frame alone would tell
}

/// A desk and what stands on it, seen by a fast hand.
TEST(MovingThings, ASceneThatStandsHasNone) {
  int num_split = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SceneRandom random(seed);
    std::vector<Eigen::Vector3d> points;
    for (int i = 0; i < 240; ++i) {
      const double x = random.uniform(-1.5, 1.5);
      const double y = random.uniform(-0.7, 0.7);
      points.emplace_back(x, y, i % 3 == 0 ? random.uniform(1.5, 4.0) : 2.0 - 0.8 * y);
    }
    const Rigid3 step(so3_exp({0.004, 0.008, 0.002}), {0.02, 0.002, 0.004});
    const DriveTracks hand(DriveTracks::repeat(step, 3), points, 0.5, seed);
    const Matches pairs = hand.matches(0, 2);
    const PixelPairs pixels(pairs.prev_uv, pairs.cur_uv);
    const TwoViewEstimator estimator{Options()};
    const MeasuredMotion all = estimator.measure(pixels, hand.camera, true);
    num_split += find_rivals(all, pixels, hand.camera, {}, estimator).has_value() ? 1 : 0;
  }
  EXPECT_LE(num_split, 2);
}

TEST(StandingCamera, StandsByTheMedianFlowOfTwentyTracks) {
  Observations before;
  Observations now;
  for (int i = 0; i < 21; ++i) {
    const Eigen::Vector2d uv(10.0 * i, 50.0);
    before.push_back({i, uv});
    now.push_back({i, uv + Eigen::Vector2d(i < 10 ? 30.0 : 0.1, 0.0)});  // others pass by
  }
  EXPECT_NEAR(stationary_flow_px(before, now, 0.15, 20).value_or(30.0), 0.1, 1e-9);
  EXPECT_FALSE(stationary_flow_px(before, now, 0.05, 20).has_value());
  EXPECT_FALSE(stationary_flow_px(before, {now.begin(), now.begin() + 19}, 0.15, 20).has_value());
  now[10].uv.x() += 30.0;
  EXPECT_FALSE(stationary_flow_px(before, now, 0.15, 20).has_value());
}

TEST(StandingCamera, StaysWhileOthersPassBy) {
  Observations before;
  Observations now;
  for (int i = 0; i < 100; ++i) {  // a few tracks all over the image, many on a car
    const Eigen::Vector2d uv(i < 30 ? 40.0 * i : 500.0 + 2.0 * i, 150.0);
    before.push_back({i, uv});
    now.push_back({i, uv + Eigen::Vector2d(i < 30 ? 0.05 : 8.0, 0.0)});
  }
  EXPECT_TRUE(stationary_flow_px(before, now, 0.15, 20).has_value());
}

constexpr int kFlock = 40;

/// A flock that goes right in a still world: ids 0 to 39 go, 100 to 139 stay.
Matches flock(int frame, double px_per_frame) {
  Matches matches;
  SceneRandom random(8);
  for (int i = 0; i < kFlock; ++i) {
    const Eigen::Vector2d corner(random.uniform(400.0, 600.0), random.uniform(100.0, 250.0));
    matches.track_ids.push_back(i);
    matches.prev_uv.emplace_back(corner.x() + px_per_frame * (frame - 1), corner.y());
    matches.cur_uv.emplace_back(corner.x() + px_per_frame * frame, corner.y());
  }
  for (int i = 100; i < 140; ++i) {
    const Eigen::Vector2d corner(random.uniform(0.0, 300.0), random.uniform(100.0, 250.0));
    matches.track_ids.push_back(i);
    matches.prev_uv.push_back(corner);
    matches.cur_uv.push_back(corner);
  }
  return matches;
}

std::vector<char> of_flock(const Matches& matches) {
  std::vector<char> flags(matches.track_ids.size(), 0);
  std::fill_n(flags.begin(), kFlock, char{1});
  return flags;
}
std::vector<char> of_world(const Matches& matches) {
  return without(of_flock(matches), std::vector<char>(matches.track_ids.size(), 1));
}

TEST(MovingTracks, TracksJoinAThingAndLeaveIt) {
  MovingTracks moving{Options()};
  Matches matches = flock(1, 3.0);
  const std::vector<char> fits_world = of_world(matches);
  // One of the flock is not named at first, one of the world is.
  std::vector<char> named = of_flock(matches);
  named.front() = 0;
  named.back() = 1;
  moving.add(matches, named);
  for (int frame = 1; frame <= 4; ++frame) {
    moving.observe(flock(frame, 3.0), fits_world);
  }
  EXPECT_EQ(moving.flags(matches, {}), of_flock(matches));
}

TEST(MovingTracks, WhatMovesApartFromThePoseTwiceIsAThing) {
  MovingTracks moving{Options()};
  Matches matches = flock(1, 3.0);
  const std::vector<char> fits_pose = of_world(matches);
  moving.find(matches, fits_pose);
  EXPECT_TRUE(moving.empty());
  moving.find(flock(2, 3.0), fits_pose);
  EXPECT_EQ(moving.flags(matches, {}), of_flock(matches));

  MovingTracks scattered{Options()};
  SceneRandom random(3);
  for (std::size_t i = 0; i < kFlock; ++i) {  // wrong matches are no thing
    matches.cur_uv[i] += Eigen::Vector2d(random.uniform(-20.0, 20.0), random.uniform(-20.0, 20.0));
  }
  for (int frame = 0; frame < 5; ++frame) {
    scattered.find(matches, fits_pose);
  }
  EXPECT_TRUE(scattered.empty());
}

TEST(MovingTracks, CornersBesideAThingAreNotTakenForLandmarks) {
  MovingTracks moving{Options()};
  Matches matches;
  for (int i = 0; i < 4; ++i) {
    matches.track_ids.push_back(i);
    matches.cur_uv.emplace_back(100.0 + 12.0 * i, 100.0);
  }
  moving.add(matches, {1, 0, 0, 0});
  EXPECT_EQ(moving.flags(matches, {}), std::vector<char>({1, 1, 0, 0}));
  EXPECT_EQ(moving.flags(matches, {{1, Eigen::Vector3d::UnitZ()}}),
            std::vector<char>({1, 0, 0, 0}));
}

TEST(MovingTracks, NoneJoinsAThingThatStandsAsTheWorldDoes) {
  MovingTracks moving{Options()};
  Matches matches = flock(1, 0.0);
  moving.add(matches, of_flock(matches));
  matches.track_ids.push_back(200);  // of the world, seen between the thing's
  matches.prev_uv.push_back(matches.prev_uv.front());
  matches.cur_uv.push_back(matches.cur_uv.front());
  for (int frame = 0; frame < 3; ++frame) {
    moving.observe(matches, std::vector<char>(matches.track_ids.size(), 1));
  }
  EXPECT_EQ(moving.flags(matches, {{200, Eigen::Vector3d::UnitZ()}}).back(), 0);
}

}  // namespace
}  // namespace stemvo
