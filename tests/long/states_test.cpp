// SPDX-License-Identifier: MIT
#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "evaluation/trajectory.hpp"
#include "support/drives.hpp"
#include "support/run_program.hpp"
#include "support/state_drives.hpp"
#include "support/state_runs.hpp"

namespace stemvo {
namespace {

namespace fs = std::filesystem;
using test::column;
using test::expect_accurate;
using test::kDeg;
using test::ProgramResult;
using test::read_file;
using test::run_states;
using test::run_stemvo;
using test::StateDrive;
using test::StateRun;
using test::TempFolder;

class States : public ::testing::TestWithParam<std::string> {
 protected:
  [[nodiscard]] bool is_map() const { return GetParam() == "map"; }

  /// Mode two_frame knows no lengths: they are given, and then standing still is given too.
  [[nodiscard]] StateRun run(const fs::path& sequence) const {
    return run(sequence, is_map() ? "camera_height" : "ground_truth");
  }
  /// Lengths that nobody gave.
  [[nodiscard]] StateRun run_without_truth(const fs::path& sequence) const {
    return run(sequence, is_map() ? "camera_height" : "constant_speed");
  }
  [[nodiscard]] StateRun run(const fs::path& sequence, const std::string& scale) const {
    return run_states(sequence, GetParam(), scale);
  }
};

/// Slower steps may have little parallax: far scenery hardly moves.
constexpr double kSlow_m = 0.15;

/// The event's frames have its state, and no other frame has one that is not driving.
void expect_states(const StateRun& result, const StateDrive& drive, const std::string& event) {
  ASSERT_EQ(result.states.size(), drive.world_from_camera.size());
  for (std::size_t i = 1; i < result.states.size(); ++i) {
    const int frame = static_cast<int>(i);
    if (frame >= drive.event_begin && frame < drive.event_end) {
      EXPECT_EQ(result.states[i], event) << i;
    } else {
      const double step_m =
          (drive.world_from_camera[i].translation - drive.world_from_camera[i - 1].translation)
              .norm();
      const bool is_slow = step_m < kSlow_m && result.states[i] == "low_parallax";
      EXPECT_TRUE(result.states[i] == "tracking" || result.states[i] == "initializing" || is_slow)
          << i << ": " << result.states[i];
    }
  }
}

TEST_P(States, StandingInTheMiddle) {
  const StateDrive drive = test::standing_drive();
  const fs::path sequence = test::rendered_along("standing", drive);
  const Trajectory poses_without_truth = run_without_truth(sequence).poses;
  const StateRun result = run(sequence);
  expect_states(result, drive, "stationary");
  const auto begin = static_cast<std::size_t>(drive.event_begin);
  const auto end = static_cast<std::size_t>(drive.event_end);
  ASSERT_EQ(poses_without_truth.size(), drive.world_from_camera.size());
  const Rigid3 moved = poses_without_truth[begin].inverse() * poses_without_truth[end - 1];
  // A window's pose is measured, not held: 0.2 % of a depth of 10 m at most.
  EXPECT_LE(moved.translation.norm(), is_map() ? 0.02 : 1e-6);
  EXPECT_LE(moved.angle_rad(), is_map() ? 2e-3 : 1e-6);
  const int num_frames = static_cast<int>(result.poses.size());
  expect_accurate(result.poses, drive, 10, drive.event_begin, 0.05, 0.3 * kDeg);
  expect_accurate(result.poses, drive, drive.event_end - 1, num_frames, 0.05, 0.3 * kDeg);
}

TEST_P(States, TurningOnTheSpot) {
  const StateDrive drive = test::turning_drive();
  const fs::path sequence = test::rendered_along("turning", drive);
  const Trajectory poses_without_truth = run_without_truth(sequence).poses;
  const StateRun result = run(sequence);
  expect_states(result, drive, "rotating");
  const auto before = static_cast<std::size_t>(drive.event_begin - 1);
  const auto after = static_cast<std::size_t>(drive.event_end - 1);
  ASSERT_EQ(poses_without_truth.size(), drive.world_from_camera.size());
  const Rigid3 turned = poses_without_truth[before].inverse() * poses_without_truth[after];
  EXPECT_NEAR(turned.angle_rad(), 16 * test::kTurnPerFrame_rad, 0.4 * kDeg);
  EXPECT_LE(turned.translation.norm(), is_map() ? 0.03 : 1e-6);  // 0.2 % of a depth of 15 m
  const int num_frames = static_cast<int>(result.poses.size());
  expect_accurate(result.poses, drive, 10, drive.event_begin, 0.05, 0.3 * kDeg);
  expect_accurate(result.poses, drive, drive.event_end - 1, num_frames, 0.05, 0.3 * kDeg);
}

TEST_P(States, CutToAnotherPlace) {
  const StateDrive drive = test::cut_drive();
  const StateRun result = run(test::rendered_along("cut", drive));
  expect_states(result, drive, "lost");
  const auto cut = static_cast<std::size_t>(drive.event_begin);
  if (is_map()) {
    // Nothing is measured of the road on a motion that was not; the new map has no scale yet.
    EXPECT_EQ(result.roads[cut], "held");
    EXPECT_NE(result.roads[cut + 1], "held");
    EXPECT_EQ(result.roads[cut - 1], "measured");
    EXPECT_EQ(result.roads[cut + 3], "measured");
    // The motion went on as it was: the pose is wrong by no more than the jump itself.
    const double step = (result.poses[cut].translation - result.poses[cut - 1].translation).norm();
    EXPECT_NEAR(step, test::kDriveStep_m, 0.1 * test::kDriveStep_m);
  }
  const int num_frames = static_cast<int>(result.poses.size());
  expect_accurate(result.poses, drive, 10, drive.event_begin, 0.05, 0.3 * kDeg);
  expect_accurate(result.poses, drive, drive.event_begin + 3, num_frames, 0.05, 0.3 * kDeg);
}

INSTANTIATE_TEST_SUITE_P(Modes,
                         States,
                         ::testing::Values("map", "two_frame"),
                         [](const auto& mode) { return mode.param; });

TEST(RoadStates, WithoutARoadTheScaleIsHeldAndItsDoubtGrows) {
  const TempFolder folder;
  const StateDrive drive = test::standing_drive();
  const fs::path from = test::rendered_along("standing", drive);
  const fs::path sequence = folder.path() / "sequences" / "00";
  fs::create_directories(sequence.parent_path());
  fs::copy(from, sequence, fs::copy_options::recursive);
  for (int i = 20; i < 35; ++i) {  // something covers the lower part of the image
    char name[32];
    std::snprintf(name, sizeof(name), "image_2/%06d.png", i);
    cv::Mat image = cv::imread((sequence / name).string(), cv::IMREAD_COLOR);
    ASSERT_FALSE(image.empty());
    image.rowRange(image.rows * 52 / 100, image.rows).setTo(cv::Scalar(90, 90, 90));
    cv::imwrite((sequence / name).string(), image);
  }
  const std::string out = folder / "result";
  const ProgramResult done =
      run_stemvo({"run", sequence.string(), "--out", out, "--quiet", "--frames", "0:45", "--set",
                  "odometry.mode=map", "--set", "scale.source=camera_height"});
  ASSERT_EQ(done.exit_code, 0) << done.err;
  const std::string csv = read_file(out + "/frames.csv");
  const std::vector<std::string> roads = column(csv, "scale_state");
  const std::vector<std::string> sigmas = column(csv, "scale_sigma");
  const auto poses = read_kitti_trajectory(out + "/trajectory_kitti.txt");
  ASSERT_TRUE(poses) << poses.error().message;
  for (std::size_t i = 15; i < 45; ++i) {
    // Frame 35 still has only covered images behind it.
    const bool is_covered = i >= 20 && i < 35;
    if (i != 35) {
      EXPECT_EQ(roads[i], is_covered ? "held" : "measured") << i;
    }
    if (is_covered && i > 20) {
      EXPECT_GT(std::stod(sigmas[i]), std::stod(sigmas[i - 1])) << i;
    }
    if (i < 40) {
      EXPECT_NEAR(((*poses)[i].translation - (*poses)[i - 1].translation).norm(),
                  test::kDriveStep_m, 0.06 * test::kDriveStep_m)
          << i;
    }
  }
}

}  // namespace
}  // namespace stemvo
