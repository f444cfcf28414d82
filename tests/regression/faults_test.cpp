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

/// Results under their final names are whole or absent, but for frames.csv, which grows by lines.
class Faults : public ::testing::Test {
 protected:
  [[nodiscard]] std::vector<std::string> arguments() const {
    return {"run", drive_, "--out", out_.string(), "--quiet", "--pictures", "5"};
  }

  void expect_whole() const {
    for (const char* name : {"trajectory_kitti.txt", "trajectory_tum.txt"}) {
      if (fs::exists(out_ / name)) {
        EXPECT_EQ(std::ranges::count(read_file(out_ / name), '\n'), kNumFrames) << name;
      }
    }
    if (fs::exists(out_ / "metrics.json")) {
      EXPECT_TRUE(nlohmann::json::accept(read_file(out_ / "metrics.json")));
    }
    if (fs::exists(out_ / "trajectory.svg")) {
      EXPECT_THAT(read_file(out_ / "trajectory.svg"), ::testing::EndsWith("</svg>\n"));
    }
    for (const auto& entry : fs::recursive_directory_iterator(out_)) {
      if (entry.path().extension() == ".png") {
        EXPECT_FALSE(cv::imread(entry.path().string()).empty()) << entry.path();
        EXPECT_THAT(read_file(entry.path()), HasSubstr("IEND")) << entry.path();
      }
    }
  }

  TempFolder folder_;
  fs::path out_ = folder_ / "out";
  std::string drive_ =
      test::rendered_drive({.frames = kNumFrames, .width_px = 320, .height_px = 96}) /
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
