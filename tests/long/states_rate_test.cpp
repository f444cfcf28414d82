// SPDX-License-Identifier: MIT
// The events of states_test.cpp at three times the frames, and a camera in the hand: the same
// defaults.
#include <filesystem>
#include <span>

#include <gtest/gtest.h>

#include "evaluation/metrics.hpp"
#include "support/drives.hpp"
#include "support/state_drives.hpp"
#include "support/state_runs.hpp"

namespace stemvo {
namespace {

namespace fs = std::filesystem;
using test::kDeg;
using test::StateDrive;
using test::StateRun;

constexpr int kRate = 3;  ///< frames per 0.1 s
/// Slower steps may wait for parallax: far scenery hardly moves.
constexpr double kSlow_m = 0.08;

double step_m(const Trajectory& poses, std::size_t i) {
  return (poses[i].translation - poses[i - 1].translation).norm();
}

void expect_event(const StateRun& result, const StateDrive& drive, const std::string& event) {
  const Trajectory& truth = drive.world_from_camera;
  ASSERT_EQ(result.states.size(), truth.size());
  for (int i = 1; i < static_cast<int>(truth.size()); ++i) {
    if (i == drive.event_begin && event == "rotating") {
      // The last steps before it may be too short to be seen one by one: they are caught up here.
      result.expect_states(i, i + 1, {event, "tracking"});
    } else if (i >= drive.event_begin && i < drive.event_end) {
      result.expect_states(i, i + 1, {event});
    } else if (step_m(truth, static_cast<std::size_t>(i)) < kSlow_m) {
      result.expect_states(i, i + 1,
                           {"tracking", "initializing", "low_parallax", "stationary", "rotating"});
    } else {
      result.expect_states(i, i + 1, {"tracking", "initializing"});
    }
  }
}

/// Before the event and after it, as at ten frames a second.
void expect_accurate_drive(const StateRun& result, const StateDrive& drive, int after) {
  const int num_frames = static_cast<int>(result.poses.size());
  test::expect_accurate(result.poses, drive, 10 * kRate, drive.event_begin, 0.05, 0.3 * kDeg,
                        10 * kRate);
  test::expect_accurate(result.poses, drive, after, num_frames, 0.05, 0.3 * kDeg, 10 * kRate);
}

StateRun run_event(const std::string& name, const StateDrive& drive, const std::string& event) {
  StateRun result = test::run_states(test::rendered_along(name, drive), "map", "camera_height");
  expect_event(result, drive, event);
  return result;
}

Rigid3 motion_between(const StateRun& result, int from, int to) {
  return result.poses[static_cast<std::size_t>(from)].inverse() *
         result.poses[static_cast<std::size_t>(to)];
}

TEST(StatesAtThirtyFrames, StandingInTheMiddle) {
  const StateDrive drive = test::standing_drive(kRate);
  const StateRun result = run_event("standing_30", drive, "stationary");
  ASSERT_EQ(result.poses.size(), drive.world_from_camera.size());
  const Rigid3 moved = motion_between(result, drive.event_begin, drive.event_end - 1);
  // A pose is measured, not held: 0.2 % of a depth of 10 m at most.
  EXPECT_LE(moved.translation.norm(), 0.02);
  EXPECT_LE(moved.angle_rad(), 2e-3);
  expect_accurate_drive(result, drive, drive.event_end - 1);
}

TEST(StatesAtThirtyFrames, TurningOnTheSpot) {
  const StateDrive drive = test::turning_drive(kRate);
  const StateRun result = run_event("turning_30", drive, "rotating");
  ASSERT_EQ(result.poses.size(), drive.world_from_camera.size());
  const Rigid3 turned = motion_between(result, drive.event_begin - 1, drive.event_end - 1);
  EXPECT_NEAR(turned.angle_rad(), 16 * test::kTurnPerFrame_rad, 0.4 * kDeg);
  EXPECT_LE(motion_between(result, drive.event_begin, drive.event_end - 1).translation.norm(),
            0.02);
  const auto begin = static_cast<std::size_t>(drive.event_begin);
  const double braked_m =
      (drive.world_from_camera[begin - 10].inverse() * drive.world_from_camera[begin])
          .translation.norm();
  EXPECT_NEAR(motion_between(result, drive.event_begin - 10, drive.event_begin).translation.norm(),
              braked_m, 0.05 * braked_m);
  expect_accurate_drive(result, drive, drive.event_end - 1);
}

TEST(StatesAtThirtyFrames, CutToAnotherPlace) {
  const StateDrive drive = test::cut_drive(kRate);
  const StateRun result =
      test::run_states(test::rendered_along("cut_30", drive), "map", "camera_height");
  ASSERT_EQ(result.states.size(), drive.world_from_camera.size());
  expect_event(result, drive, "lost");
  const auto cut = static_cast<std::size_t>(drive.event_begin);
  EXPECT_EQ(result.roads[cut - 1], "measured");
  EXPECT_NE(result.roads[cut], "measured");
  EXPECT_NE(result.roads[cut + 1], "held");
  EXPECT_EQ(result.roads[cut + 9], "measured");
  EXPECT_NEAR(step_m(result.poses, cut), test::kDriveStep_m / kRate,
              0.1 * test::kDriveStep_m / kRate);
  expect_accurate_drive(result, drive, drive.event_begin + 9);
}

TEST(Walk, ACameraInTheHandIsFollowed) {
  const fs::path folder = test::render_walk_once(300);
  const StateRun result = test::run_states(folder / "sequences/00", "map", "none");
  const auto truth = read_kitti_trajectory(folder / "poses/00.txt");
  ASSERT_TRUE(truth) << truth.error().message;
  ASSERT_EQ(result.poses.size(), truth->size());
  result.expect_states(1, 300,
                       {"tracking", "initializing", "low_parallax", "stationary", "rotating"});
  double path_m = 0.0;
  for (std::size_t i = 1; i < truth->size(); ++i) {
    path_m += step_m(*truth, i);
  }
  EXPECT_GT(path_m, 3.0);
  // From the first one with a map on.
  std::size_t begin = 1;
  while (begin < truth->size() && result.states[begin] != "tracking") {
    ++begin;
  }
  ASSERT_LT(begin, 60U);
  const std::span<const Rigid3> online = std::span(result.poses).subspan(begin);
  EXPECT_LE(evaluate(online, std::span(*truth).subspan(begin)).ate_rmse.sim3_m, 0.01 * path_m);
}

}  // namespace
}  // namespace stemvo
