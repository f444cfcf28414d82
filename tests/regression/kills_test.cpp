// SPDX-License-Identifier: MIT
// 100 kills. Each time the command goes on with what the kill before left.
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
  }
  [[nodiscard]] std::vector<std::string> arguments(const std::string& out) const {
    const bool takes_root = GetParam().name == "benchmark";
    std::vector<std::string> words = {GetParam().name,
                                      takes_root ? folder_.path() : folder_ / "sequences/00",
                                      "--out", folder_ / out, "--quiet"};
    words.insert(words.end(), GetParam().arguments.begin(), GetParam().arguments.end());
    return words;
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
};

TEST_P(Kills, LeaveWholeFilesAndTheSameResults) {
  const auto start = std::chrono::steady_clock::now();
  const ProgramResult whole = run_stemvo(arguments("whole"));
  ASSERT_EQ(whole.exit_code, 0) << whole.err;
  const std::chrono::duration<double> whole_time = std::chrono::steady_clock::now() - start;
  std::mt19937 random(1);
  std::uniform_real_distribution<double> share(0.0, 1.0);
  int num_killed = 0;
  while (num_killed < GetParam().num_kills) {
    test::RunningProgram program(STEMVO_PROGRAM, arguments("killed"));
    std::this_thread::sleep_for(share(random) * whole_time);
    program.send(SIGKILL);
    const ProgramResult result = program.wait();
    test::expect_whole_files(folder_ / "killed");
    if (result.exit_code == 0) {  // it was faster
      EXPECT_TRUE(results("killed") == results("whole"));
      fs::remove_all(folder_ / "killed");
    } else {
      ASSERT_EQ(result.exit_code, 128 + SIGKILL) << result.err;
      ++num_killed;
    }
  }
  const ProgramResult last = run_stemvo(arguments("killed"));
  ASSERT_EQ(last.exit_code, 0) << last.err;
  EXPECT_TRUE(results("killed") == results("whole"));
}

INSTANTIATE_TEST_SUITE_P(
    Commands,
    Kills,
    ::testing::Values(Command{"run",
                              40,
                              {"--resume", "--map", "--pictures", "5"},
                              {"trajectory_kitti.txt", "trajectory_tum.txt",
                               "trajectory_refined_kitti.txt", "map.ply"}},
                      Command{"search",
                              30,
                              {"--resume", "--exhaustive", "--filters", "0:6", "--block", "2"},
                              {"filters.csv", "filters.json", "best.yaml", "sheet.png"}},
                      Command{"benchmark", 30, {}, {"benchmark.md", "benchmark.json"}}),
    ::testing::PrintToStringParamName());

}  // namespace
}  // namespace stemvo
