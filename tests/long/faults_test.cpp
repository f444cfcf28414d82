// SPDX-License-Identifier: MIT
#include <csignal>

#include "evaluation/trajectory.hpp"
#include "support/program_test.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

double length_m(const Trajectory& path) {
  double sum_m = 0.0;
  for (std::size_t i = 1; i < path.size(); ++i) {
    sum_m += (path[i].translation - path[i - 1].translation).norm();
  }
  return sum_m;
}

/// Slow frames, so that a run lasts for seconds.
class LongRun : public ::testing::Test {
 protected:
  [[nodiscard]] Words arguments() const {
    return {"run",
            drive_.string(),
            "--out",
            out_.string(),
            "--quiet",
            "--threads",
            "1",
            "--set",
            "features.method=sift",
            "--set",
            "odometry.mode=two_frame",
            "--set",
            "scale.source=ground_truth"};
  }
  [[nodiscard]] std::ptrdiff_t num_lines(const char* name) const {
    return std::ranges::count(read_file(out_ / name), '\n');
  }
  /// Waits for so many poses on disk.
  void wait_for_poses(std::ptrdiff_t count) const {
    for (int i = 0; i < 3000 && num_lines("trajectory_kitti.txt") < count; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
  }

  TempFolder folder_;
  fs::path out_ = folder_ / "out";
  fs::path drive_ =
      rendered_drive({.frames = 400, .width_px = 620, .height_px = 188}) / "sequences/00";
};

TEST_F(LongRun, HasItsFramesOnDiskWhileItRuns) {
  RunningProgram program(STEMVO_PROGRAM, arguments());
  constexpr std::ptrdiff_t kEnough = 20;
  wait_for_poses(kEnough);
  program.send(SIGKILL);
  EXPECT_EQ(program.wait().exit_code, 128 + SIGKILL) << "the run was over too soon to tell";
  const std::ptrdiff_t num_poses = num_lines("trajectory_kitti.txt");
  EXPECT_GE(num_poses, kEnough);
  EXPECT_NEAR(num_lines("frames.csv"), num_poses + 1, 1) << "a row for each frame under a header";
  // Poses so far have true steps, as all have at the end.
  const auto poses = read_kitti_trajectory(out_ / "trajectory_kitti.txt").value();
  auto truth = read_kitti_trajectory(drive_ / "../../poses/00.txt").value();
  truth.resize(poses.size());
  EXPECT_NEAR(length_m(poses), length_m(truth), 0.02 * length_m(truth));
}

TEST(SameBytes, TwoRunsAndAnyNumberOfThreadsGiveTheSameBytes) {
  const TempFolder folder;
  const std::string sequence = rendered_drive() / "sequences/00";
  std::vector<Words> variants = {{}};
  for (int round = 0; round < 3; ++round) {
    for (const char* threads : {"1", "2", "4"}) {
      variants.push_back({"--threads", threads});
    }
  }
  std::string first;
  for (std::size_t i = 0; i < variants.size(); ++i) {
    const std::string out = folder / std::to_string(i);
    succeeded(run_stemvo({"run", sequence, "--out", out}, variants[i]));
    const std::string bytes =
        read_file(out + "/trajectory_kitti.txt") + read_file(out + "/trajectory_tum.txt");
    first = i == 0 ? bytes : first;
    EXPECT_FALSE(bytes.empty());
    EXPECT_TRUE(bytes == first) << "variant " << i;
  }
}

}  // namespace
}  // namespace stemvo
