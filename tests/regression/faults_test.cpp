// SPDX-License-Identifier: MIT
#include <algorithm>
#include <chrono>
#include <csignal>
#include <random>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <sys/resource.h>

#include "support/program_test.hpp"

namespace stemvo {
namespace {

constexpr std::ptrdiff_t kNumFrames = 60;

/// Results under their final names are whole or absent; frames.csv and trajectory_kitti.txt hold
/// the frames so far.
class Faults : public ::testing::Test {
 protected:
  [[nodiscard]] std::vector<std::string> arguments() const {
    return {"run", drive_.string(), "--out", out_.string(), "--quiet", "--pictures", "5"};
  }

  void expect_whole() const {
    if (fs::exists(out_ / "trajectory_tum.txt")) {
      EXPECT_EQ(num_lines("trajectory_tum.txt"), kNumFrames);
    }
    for (const char* name : {"frames.csv", "trajectory_kitti.txt"}) {
      if (const std::string text = read_file(out_ / name); !text.empty()) {
        EXPECT_EQ(text.back(), '\n') << name;
      }
    }
    if (fs::exists(out_ / "metrics.json")) {
      EXPECT_TRUE(nlohmann::json::accept(read_file(out_ / "metrics.json")));
    }
    if (fs::exists(out_ / "report.html")) {
      EXPECT_THAT(read_file(out_ / "report.html"), ::testing::EndsWith("</html>\n"));
    }
    for (const auto& entry : fs::recursive_directory_iterator(out_)) {
      if (entry.path().extension() == ".png") {
        EXPECT_FALSE(cv::imread(entry.path().string()).empty()) << entry.path();
        EXPECT_THAT(read_file(entry.path()), HasSubstr("IEND")) << entry.path();
      }
    }
  }

  [[nodiscard]] std::ptrdiff_t num_lines(const char* name) const {
    return std::ranges::count(read_file(out_ / name), '\n');
  }

  TempFolder folder_;
  fs::path out_ = folder_ / "out";
  fs::path drive_ = test::rendered_drive({.frames = kNumFrames, .width_px = 320, .height_px = 96}) /
                    "sequences/00";
};

TEST_F(Faults, KilledAtAnyMomentFilesAreWholeOrAbsent) {
  const auto start = std::chrono::steady_clock::now();
  ASSERT_EQ(run_stemvo(arguments()).exit_code, 0);  // what is there when the others are killed
  expect_whole();
  const std::chrono::duration<double> whole_run = std::chrono::steady_clock::now() - start;
  std::mt19937 random(1);
  std::uniform_real_distribution<double> share(0.0, 1.1);
  for (int i = 0; i < 12; ++i) {
    test::RunningProgram program(STEMVO_PROGRAM, arguments());
    std::this_thread::sleep_for(share(random) * whole_run);
    program.send(SIGKILL);
    static_cast<void>(program.wait());
    expect_whole();
  }
}

/// Slow frames, so that a run lasts for seconds.
class LongRun : public Faults {
 protected:
  [[nodiscard]] std::vector<std::string> arguments() const {
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
            "odometry.mode=two_frame"};
  }
  /// Waits for the first poses on disk.
  void wait_for_poses() const {
    for (int i = 0; i < 3000 && !fs::exists(out_ / "trajectory_kitti.txt"); ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
  }

  fs::path drive_ =
      test::rendered_drive({.frames = 400, .width_px = 620, .height_px = 188}) / "sequences/00";
};

TEST_F(LongRun, KeepsItsFramesOnDiskEveryTwoSeconds) {
  test::RunningProgram program(STEMVO_PROGRAM, arguments());
  wait_for_poses();
  std::ptrdiff_t rows = 0;
  auto last_growth = std::chrono::steady_clock::now();
  for (int i = 0; i < 250; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
    const auto now = std::chrono::steady_clock::now();
    if (const std::ptrdiff_t found = num_lines("frames.csv"); found > rows) {
      rows = found;
      last_growth = now;
    }
    EXPECT_LT(now - last_growth, std::chrono::seconds(2));
  }
  program.send(SIGKILL);
  EXPECT_EQ(program.wait().exit_code, 128 + SIGKILL) << "the run was over too soon to tell";
  EXPECT_GT(rows, 10);
  EXPECT_EQ(num_lines("frames.csv") - 1, num_lines("trajectory_kitti.txt"));
  const ProgramResult judged =
      run_stemvo({"evaluate", "--gt", (out_ / "trajectory_kitti.txt").string(),
                  (out_ / "trajectory_kitti.txt").string()});
  EXPECT_EQ(judged.exit_code, 0) << judged.err;
}

TEST_F(LongRun, ASecondProcessIsRefusedUntilTheFirstIsGone) {
  test::RunningProgram first(STEMVO_PROGRAM, arguments());
  wait_for_poses();
  const std::vector<std::string> channel = {"channel", drive_.string(), "--out", out_.string()};
  expect_error(run_stemvo(arguments()), 1, {out_.string(), "no other stemvo writes to"});
  expect_error(run_stemvo(channel), 1, {out_.string(), "no other stemvo writes to"});
  first.send(SIGKILL);
  static_cast<void>(first.wait());
  EXPECT_EQ(run_stemvo(channel).exit_code, 0) << "the lock of a process that was killed is gone";
  for (const auto& entry : fs::directory_iterator(out_)) {
    EXPECT_THAT(entry.path().filename().string(), Not(StartsWith("."))) << "nothing of a lock";
  }
}

TEST_F(Faults, TwoRendersOfOneDrive) {
  const std::vector<std::string> arguments = {"synth", out_.string(), "--frames", "60"};
  test::RunningProgram first(STEMVO_PROGRAM, arguments);
  for (int i = 0; i < 3000 && !fs::exists(out_ / "sequences/00.unfinished/calib.txt"); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  expect_error(run_stemvo(arguments), 1, {"00.unfinished", "no other stemvo writes to"});
  first.send(SIGKILL);
  static_cast<void>(first.wait());
  const ProgramResult again = run_stemvo({"synth", out_.string(), "--frames", "2"});
  EXPECT_EQ(again.exit_code, 0) << again.err;
}

TEST_F(Faults, AFileThatMayNotGrowIsAnErrorThatNamesIt) {
  struct rlimit before = {};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
  int num_failed = 0;
  for (const rlim_t bytes : {1000U, 6000U, 15000U, 40000U}) {
    fs::remove_all(out_);
    const struct rlimit small = {bytes, before.rlim_max};
    ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &small), 0);
    test::RunningProgram program(STEMVO_PROGRAM, arguments());
    ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &before), 0);
    const ProgramResult result = program.wait();
    if (result.exit_code != 0) {
      ++num_failed;
      expect_error(result, 1, {out_.string(), "File too large"});
    }
    expect_whole();
  }
  EXPECT_GE(num_failed, 2);
}

}  // namespace
}  // namespace stemvo
