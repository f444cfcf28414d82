// SPDX-License-Identifier: MIT
#include "evaluation/metrics.hpp"
#include "support/drives.hpp"
#include "support/state_drives.hpp"
#include "support/state_runs.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

/// Slower steps may have little parallax: far scenery hardly moves.
constexpr double kSlow_m = 0.15;

double step_m(const Trajectory& poses, std::size_t i) {
  return (poses[i].translation - poses[i - 1].translation).norm();
}

/// The event's frames have its state, and no other frame has one that is not driving.
void expect_states(const StateRun& result, const StateDrive& drive, const std::string& event) {
  ASSERT_EQ(result.states.size(), drive.world_from_camera.size());
  for (std::size_t i = 1; i < result.states.size(); ++i) {
    const int frame = static_cast<int>(i);
    if (frame >= drive.event_begin && frame < drive.event_end) {
      EXPECT_EQ(result.states[i], event) << i;
    } else {
      const bool is_slow =
          step_m(drive.world_from_camera, i) < kSlow_m && result.states[i] == "low_parallax";
      EXPECT_TRUE(result.states[i] == "tracking" || result.states[i] == "initializing" || is_slow)
          << i << ": " << result.states[i];
    }
  }
}

/// Runs along the drive, which is accurate before the event and from frame `after` on.
StateRun run_event(const std::string& name,
                   const StateDrive& drive,
                   const std::string& event,
                   int after) {
  StateRun result = run_states(rendered_along(name, drive), "camera_height");
  expect_states(result, drive, event);
  const int num_frames = static_cast<int>(result.poses.size());
  expect_accurate(result.poses, drive, 10, drive.event_begin, 0.05, 0.3 * kDeg);
  expect_accurate(result.poses, drive, after, num_frames, 0.05, 0.3 * kDeg);
  return result;
}

TEST(States, TurningOnTheSpot) {
  const StateDrive drive = turning_drive();
  const StateRun result = run_event("turning", drive, "rotating", drive.event_end - 1);
  const Rigid3 turned = result.motion(drive.event_begin - 1, drive.event_end - 1);
  EXPECT_NEAR(turned.angle_rad(), 16 * kTurnPerFrame_rad, 0.4 * kDeg);
  EXPECT_LE(turned.translation.norm(), 0.03);  // 0.2 % of a depth of 15 m
}

TEST(States, CutToAnotherPlace) {
  const StateDrive drive = cut_drive();
  const StateRun result = run_event("cut", drive, "lost", drive.event_begin + 3);
  const auto cut = static_cast<std::size_t>(drive.event_begin);
  // Nothing is measured of the road on a motion that was not; the new map has no scale yet.
  EXPECT_EQ(result.roads[cut], "held");
  EXPECT_NE(result.roads[cut + 1], "held");
  EXPECT_EQ(result.roads[cut - 1], "measured");
  EXPECT_EQ(result.roads[cut + 3], "measured");
  // The motion went on as it was: the pose is wrong by no more than the jump itself.
  EXPECT_NEAR(step_m(result.poses, cut), kDriveStep_m, 0.1 * kDriveStep_m);
}

TEST(Walk, ACameraInTheHandIsFollowed) {
  const fs::path folder = render_walk_once(300);
  const StateRun result = run_states(folder / "sequences/00", "none");
  const auto truth = read_kitti_trajectory(folder / "poses/00.txt");
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
  EXPECT_LE(evaluate({online, std::span(*truth).subspan(begin)}).ate_rmse.sim3_m, 0.01 * path_m);
}

}  // namespace
}  // namespace stemvo
