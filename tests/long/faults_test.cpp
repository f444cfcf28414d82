// SPDX-License-Identifier: MIT
#include <algorithm>
#include <chrono>
#include <csignal>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <sys/mount.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include "report/frames_csv.hpp"
#include "support/program_test.hpp"
#include "support/whole_files.hpp"

namespace stemvo {
namespace {

constexpr std::ptrdiff_t kNumFrames = 60;

class Faults : public ::testing::Test {
 protected:
  [[nodiscard]] std::vector<std::string> arguments() const {
    return {"run", drive_.string(), "--out", out_.string(), "--quiet", "--pictures", "5"};
  }

  [[nodiscard]] std::ptrdiff_t num_lines(const char* name) const {
    return std::ranges::count(read_file(out_ / name), '\n');
  }

  TempFolder folder_;
  fs::path out_ = folder_ / "out";
  fs::path drive_ = test::rendered_drive({.frames = kNumFrames, .width_px = 320, .height_px = 96}) /
                    "sequences/00";
};

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
  fs::create_directories(out_);
  write_file(out_ / "frames.csv", std::string(frames_csv_header()));  // of an earlier run
  write_file(out_ / "metrics.json", "{}\n");
  write_file(out_ / "map.ply", "ply\n");
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
  for (const char* name : {"metrics.json", "map.ply"}) {
    EXPECT_FALSE(fs::exists(out_ / name)) << "an earlier run's would pass for this one's";
  }
  const ProgramResult judged =
      run_stemvo({"evaluate", "--gt", (out_ / "trajectory_kitti.txt").string(),
                  (out_ / "trajectory_kitti.txt").string()});
  EXPECT_EQ(judged.exit_code, 0) << judged.err;
}

TEST_F(LongRun, AFolderThatIsRemovedIsAnErrorThatNamesIt) {
  std::vector<std::string> some = arguments();
  some.insert(some.end(), {"--frames", "0:80"});
  test::RunningProgram program(STEMVO_PROGRAM, some);
  wait_for_poses();
  fs::remove_all(out_);
  expect_error(program.wait(), 1, {out_.string(), "No such file or directory"});
}

TEST_F(LongRun, ASecondProcessIsRefusedUntilTheFirstIsGone) {
  test::RunningProgram first(STEMVO_PROGRAM, arguments());
  wait_for_poses();
  const std::vector<std::string> channel = {"channel", drive_.string(), "--out", out_.string()};
  expect_error(run_stemvo(arguments()), 1, {out_.string(), "no other stemvo writes to"});
  const std::vector<std::string> search = {"search", drive_.string(), "--out", out_.string()};
  for (const std::vector<std::string>& other : {channel, search}) {
    expect_error(run_stemvo(other), 1, {out_.string(), "no other stemvo writes to"});
  }
  first.send(SIGKILL);
  static_cast<void>(first.wait());
  EXPECT_EQ(run_stemvo(channel).exit_code, 0) << "the lock of a process that was killed is gone";
  for (const auto& entry : fs::directory_iterator(out_)) {
    EXPECT_THAT(entry.path().filename().string(), Not(StartsWith("."))) << "nothing of a lock";
  }
}

/// Of a disk that fails, a pipe that nobody writes to, a device that never ends.
TEST_F(Faults, AFrameThatCannotBeReadInTheMiddleIsAWarning) {
  const fs::path sequence = test::copy_drive(folder_.path(), 30);
  const auto replace = [&](const char* name, const char* by) {
    fs::remove(sequence / "image_2" / name);
    fs::create_symlink(by, sequence / "image_2" / name);
  };
  replace("000009.png", "/proc/self/mem");  // reading it is an input/output error
  replace("000014.png", "/dev/zero");
  fs::remove(sequence / "image_2/000019.png");
  ASSERT_EQ(::mkfifo((sequence / "image_2/000019.png").c_str(), 0600), 0);
  const ProgramResult result =
      run_stemvo({"run", sequence.string(), "--out", out_.string(), "--quiet"});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_THAT(result.err, AllOf(HasSubstr("000009.png: cannot read: Input/output error"),
                                HasSubstr("000014.png: expected a file, found a device"),
                                HasSubstr("000019.png: expected a file, found a pipe")));
  EXPECT_EQ(std::ranges::count(result.err, '\n'), 3) << result.err;
  EXPECT_EQ(num_lines("trajectory_tum.txt"), 30);
}

TEST_F(Faults, TwoRendersOfOneDrive) {
  const std::vector<std::string> arguments = {"synth", out_.string(), "--frames", "60"};
  test::RunningProgram first(STEMVO_PROGRAM, arguments);
  for (int i = 0; i < 3000 && !fs::exists(out_ / "sequences/00/image_2/000000.png"); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  expect_error(run_stemvo(arguments), 1, {"sequences/00", "no other stemvo writes to"});
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
    test::expect_whole_files(out_);
  }
  EXPECT_GE(num_failed, 2);
}

/// A disk of 400 kB that goes.
class SmallDisk {
 public:
  explicit SmallDisk(fs::path folder) : folder_(std::move(folder)) {
    fs::create_directories(folder_);
    is_there_ = ::mount("tmpfs", folder_.c_str(), "tmpfs", 0, "size=400k") == 0;
  }
  ~SmallDisk() {
    if (is_there_) {
      ::umount(folder_.c_str());
    }
  }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;
  [[nodiscard]] bool is_there() const { return is_there_; }

 private:
  fs::path folder_;
  bool is_there_ = false;
};

TEST_F(Faults, OnAFullDiskPosesComeBeforeImages) {
  const SmallDisk disk(out_);
  if (!disk.is_there()) {
    GTEST_SKIP() << "expected root, who can mount";
  }
  write_file(out_ / "fill", std::string(100 << 10, ' '));
  expect_error(run_stemvo(arguments()), 1, {out_.string(), "No space left on device"});
  EXPECT_EQ(num_lines("trajectory_kitti.txt"), kNumFrames);
  EXPECT_EQ(num_lines("trajectory_refined_tum.txt"), kNumFrames);
  EXPECT_EQ(num_lines("frames.csv"), kNumFrames + 1);
}

}  // namespace
}  // namespace stemvo
