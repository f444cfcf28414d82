// SPDX-License-Identifier: MIT
// 100 kills. Each time the command goes on with what the kill before left; the first of a run with
// what an earlier run of another configuration did.
#include <chrono>
#include <csignal>
#include <functional>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>

#include "support/program_test.hpp"
#include "support/whole_files.hpp"

namespace stemvo {
namespace {

using ::testing::AnyOf;

/// A command that goes on where it was stopped.
struct Command {
  std::string name;
  int num_kills = 0;
  std::vector<std::string> arguments;  ///< behind the input and --out
  std::vector<std::string> results;    ///< that no kill may change
};

void PrintTo(const Command& command, std::ostream* out) { *out << command.name; }

class Kills : public ::testing::TestWithParam<Command> {
 protected:
  Kills() {
    for (const char* name : {"00", "01"}) {
      fs::create_directories(folder_ / "sequences");
      fs::create_directories(folder_ / "poses");
      fs::create_directory_symlink(drive_ / "sequences/00", folder_ / "sequences" / name);
      fs::create_symlink(drive_ / "poses/00.txt", folder_ / "poses" / (std::string(name) + ".txt"));
    }
    test::link_long_drive(drive_ / "sequences/00", long_drive_, 400);
  }
  [[nodiscard]] std::vector<std::string> arguments(const std::string& out) const {
    const bool takes_root = GetParam().name == "benchmark";
    const fs::path input = takes_root ? folder_.path()
                           : is_run() ? long_drive_
                                      : folder_ / "sequences/00";
    std::vector<std::string> words = {GetParam().name, input, "--out", folder_ / out};
    words.insert(words.end(), GetParam().arguments.begin(), GetParam().arguments.end());
    return words;
  }
  [[nodiscard]] static bool is_run() { return GetParam().name == "run"; }

  /// What lies in "killed" before its first command.
  void begin() const {
    fs::remove_all(folder_ / "killed");
    if (is_run()) {
      fs::copy(folder_ / "earlier", folder_ / "killed", fs::copy_options::recursive);
    }
  }

  /// All that lies in "killed" is of one run: of that whose config.yaml lies there.
  void expect_of_one_run() const {
    const auto file = [this](const std::string& out, const fs::path& name) {
      return read_file(folder_ / out / name);
    };
    const std::string header =
        file("whole", "frames.csv").substr(0, file("whole", "frames.csv").find('\n') + 1);
    const bool is_earlier = file("killed", "config.yaml") == file("earlier", "config.yaml");
    const std::string of = is_earlier ? "earlier" : "whole";
    EXPECT_TRUE(file("killed", "config.yaml") == file(of, "config.yaml"));
    if (is_earlier) {
      EXPECT_THAT(file("killed", "frames.csv"), AnyOf(header, file("earlier", "frames.csv")));
    }
    for (const auto& entry : fs::recursive_directory_iterator(folder_ / "killed")) {
      const fs::path name = fs::relative(entry.path(), folder_ / "killed");
      if (name.extension() == ".unfinished" || name == "checkpoint" || name == "frames.csv") {
        continue;
      }
      EXPECT_TRUE(fs::exists(folder_ / of / name)) << name;
      if (name.parent_path() == "pictures") {
        EXPECT_TRUE(read_file(entry.path()) == file(of, name)) << name;
      } else if (name == "trajectory_kitti.txt") {
        EXPECT_THAT(file(of, name), StartsWith(read_file(entry.path())));
      }
    }
  }

  [[nodiscard]] std::string results(const std::string& out) const {
    std::string bytes;
    for (const std::string& name : GetParam().results) {
      bytes += read_file(folder_ / out / name);
    }
    return bytes;
  }

  TempFolder folder_;
  fs::path drive_ = test::rendered_drive({.frames = 60, .width_px = 320, .height_px = 96});
  fs::path long_drive_ = folder_ / "long";
};

TEST_P(Kills, LeaveWholeFilesAndTheSameResults) {
  const auto start = std::chrono::steady_clock::now();
  const ProgramResult whole = run_stemvo(arguments("whole"));
  ASSERT_EQ(whole.exit_code, 0) << whole.err;
  for (const std::string& name : GetParam().results) {
    EXPECT_TRUE(fs::exists(folder_ / "whole" / name)) << name;
  }
  std::chrono::duration<double> longest = std::chrono::steady_clock::now() - start;
  if (is_run()) {
    longest = std::chrono::milliseconds(1500);  // checkpoints come to the disk after one
    ASSERT_EQ(run_stemvo({"run", long_drive_, "--out", folder_ / "earlier", "--frames", "0:20",
                          "--pictures", "3", "--set", "features.max_features=300"})
                  .exit_code,
              0);
  }
  begin();
  std::mt19937 random(1);
  std::uniform_real_distribution<double> share(0.0, 1.0);
  int num_killed = 0;
  int num_gone_on = 0;
  while (num_killed < GetParam().num_kills) {
    test::RunningProgram program(STEMVO_PROGRAM, arguments("killed"));
    std::this_thread::sleep_for(share(random) * longest);
    program.send(SIGKILL);
    const ProgramResult result = program.wait();
    num_gone_on += result.err.find("goes on at frame ") != std::string::npos ? 1 : 0;
    test::expect_whole_files(folder_ / "killed");
    if (is_run()) {
      expect_of_one_run();
    }
    if (result.exit_code == 0) {  // it was faster
      EXPECT_TRUE(results("killed") == results("whole"));
      begin();
    } else {
      ASSERT_EQ(result.exit_code, 128 + SIGKILL) << result.err;
      ++num_killed;
    }
  }
  const ProgramResult last = run_stemvo(arguments("killed"));
  ASSERT_EQ(last.exit_code, 0) << last.err;
  EXPECT_TRUE(results("killed") == results("whole"));
  if (is_run()) {
    RecordProperty("gone_on", num_gone_on);
    EXPECT_GE(num_gone_on, 5) << "of " << num_killed << ", from a checkpoint";
  }
}

/// Killed while a drive takes the place of another, which begins with its mark.
TEST(KillsOfSynth, LeaveAWholeDriveOrNone) {
  const TempFolder folder;
  const fs::path sequences = folder / "drive/sequences";
  const auto arguments = [&](int seed) {
    return std::vector<std::string>{
        "synth", folder / "drive", "--frames", "100",    "--width",
        "64",    "--height",       "32",       "--seed", std::to_string(seed)};
  };
  const auto num_frames = [](const fs::path& drive) {
    return std::distance(fs::directory_iterator(drive / "image_2"), fs::directory_iterator());
  };
  ASSERT_EQ(run_stemvo(arguments(1)).exit_code, 0);
  std::mt19937 random(1);
  std::uniform_int_distribution<int> delay_us(0, 1500);
  int num_killed = 0;
  for (int i = 0; i < 10; ++i) {
    test::RunningProgram program(STEMVO_PROGRAM, arguments(2 + i));
    const auto give_up = std::chrono::steady_clock::now() + std::chrono::seconds(30);
    std::error_code code;
    const fs::path mark = sequences / "00.unfinished/rendered_by_stemvo";
    while (std::chrono::steady_clock::now() < give_up) {
      if (const auto size = fs::file_size(mark, code); !code && size > 0) {
        break;
      }
      std::this_thread::sleep_for(std::chrono::microseconds(50));
    }
    std::this_thread::sleep_for(std::chrono::microseconds(delay_us(random)));
    program.send(SIGKILL);
    const ProgramResult result = program.wait();
    EXPECT_THAT(result.exit_code, AnyOf(0, 128 + SIGKILL)) << result.err;
    num_killed += result.exit_code != 0;
    if (fs::exists(sequences / "00")) {
      EXPECT_EQ(num_frames(sequences / "00"), 100) << i;
    }
  }
  EXPECT_GT(num_killed, 0);
  const ProgramResult last = run_stemvo(arguments(1));
  ASSERT_EQ(last.exit_code, 0) << last.err;
  EXPECT_EQ(num_frames(sequences / "00"), 100);
  EXPECT_EQ(std::distance(fs::directory_iterator(sequences), fs::directory_iterator()), 1);
}

/// Killed before its mark had its name, or while the drive before was removed.
TEST(KillsOfSynth, WhatTheyLeaveIsReplaced) {
  const TempFolder folder;
  const fs::path sequences = folder / "sequences";
  fs::create_directories(sequences / "00.unfinished");
  write_file(sequences / "00.unfinished/rendered_by_stemvo.unfinished", "");
  fs::create_directories(sequences / "00.replaced/image_2");
  const std::vector<std::string> arguments = {"synth",   folder.path(), "--frames", "2",
                                              "--width", "64",          "--height", "32"};
  expect_error(run_stemvo(arguments), 1, {"00.replaced", "expected a drive that was replaced"});
  write_file(sequences / "00.replaced/rendered_by_stemvo", "");
  const ProgramResult done = run_stemvo(arguments);
  EXPECT_EQ(done.exit_code, 0) << done.err;
  EXPECT_EQ(std::distance(fs::directory_iterator(sequences), fs::directory_iterator()), 1);
}

INSTANTIATE_TEST_SUITE_P(
    Commands,
    Kills,
    ::testing::Values(
        Command{"run",
                40,
                {"--resume", "--map", "--pictures", "5"},
                {"trajectory_kitti.txt", "trajectory_tum.txt", "trajectory_refined_kitti.txt",
                 "trajectory_refined_tum.txt", "map.ply"}},
        Command{"search",
                30,
                {"--resume", "--exhaustive", "--filters", "0:6", "--block", "2", "--quiet"},
                {"filters.csv", "filters.json", "best.yaml", "sheet.png"}},
        Command{"benchmark", 30, {"--quiet"}, {"benchmark.md", "benchmark.json"}}),
    ::testing::PrintToStringParamName());

}  // namespace
}  // namespace stemvo
