// SPDX-License-Identifier: MIT
#include <chrono>
#include <csignal>
#include <filesystem>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "support/program_test.hpp"

namespace stemvo {
namespace {

/// Two rendered sequences, one of them broken on demand.
class Benchmark : public ::testing::Test {
 protected:
  void SetUp() override {
    const fs::path drive = test::rendered_drive({.frames = 30, .width_px = 310, .height_px = 94});
    for (const std::string name : {"00", "own"}) {
      fs::create_directories(kitti_ / "sequences");
      fs::create_directories(kitti_ / "poses");
      fs::copy(drive / "sequences/00", kitti_ / "sequences" / name, fs::copy_options::recursive);
      fs::copy_file(drive / "poses/00.txt", kitti_ / "poses" / (name + ".txt"));
    }
  }
  [[nodiscard]] std::vector<std::string> command(const std::string& out) const {
    return {"benchmark", kitti_.string(), "--out", folder_ / out};
  }
  [[nodiscard]] std::string reports(const std::string& out) const {
    return read_file(folder_ / (out + "/benchmark.md")) +
           read_file(folder_ / (out + "/benchmark.json"));
  }

  TempFolder folder_;
  fs::path kitti_ = folder_.path() / "kitti";
};

TEST_F(Benchmark, InterruptedAndResumedGivesTheSameBytes) {
  const ProgramResult whole = run_stemvo(command("whole"));
  ASSERT_EQ(whole.exit_code, 0) << whole.err;
  EXPECT_THAT(whole.out, HasSubstr("benchmark.md"));
  for (const char* name : {"report.html", "speed.json"}) {
    EXPECT_TRUE(fs::exists(folder_ / ("whole/" + std::string(name)))) << name;
  }
  EXPECT_THAT(
      read_file(folder_ / "whole/report.html"),
      AllOf(HasSubstr("stemvo benchmark "), HasSubstr("# paper"), HasSubstr("max_features: ")));
  for (const auto& [signal, in] : {std::pair(SIGINT, "00/default_ground_truth"),
                                   std::pair(SIGTERM, "00/paper_ground_truth")}) {
    test::RunningProgram program(STEMVO_PROGRAM, command("resumed"));
    const std::string begun = folder_ / ("resumed/runs/" + std::string(in) + "/frames.csv");
    for (int i = 0; i < 6000 && !fs::exists(begun); ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    program.send(signal);
    const ProgramResult stopped = program.wait();
    ASSERT_EQ(stopped.exit_code, 130) << stopped.err;
    EXPECT_THAT(stopped.err, HasSubstr("the same command goes on from there"));
    EXPECT_THAT(reports("resumed"), HasSubstr("not run yet"));
  }
  const ProgramResult resumed = run_stemvo(command("resumed"));
  ASSERT_EQ(resumed.exit_code, 0) << resumed.err;
  EXPECT_THAT(resumed.err, Not(HasSubstr("1/8 00, default, camera_height")));  // was done
  EXPECT_THAT(resumed.err, HasSubstr("8/8 own, paper, ground_truth"));
  EXPECT_TRUE(reports("resumed") == reports("whole"));
}

TEST_F(Benchmark, DefaultsBeatThePaperAndThePublishedStayAway) {
  ASSERT_EQ(run_stemvo(command("out")).exit_code, 0);
  const auto json = nlohmann::json::parse(read_file(folder_ / "out/benchmark.json"));
  const auto& runs = json["sequences"][0]["runs"];
  ASSERT_EQ(runs.size(), 4U);
  const auto offset = [&](std::size_t i) { return runs[i]["average_offset_m"].get<double>(); };
  const double null_offset = json["sequences"][0]["zero_motion"]["average_offset_m"].get<double>();
  EXPECT_LT(offset(1), 0.1 * null_offset);  // the defaults, per-step ground-truth scale
  EXPECT_LT(offset(1), offset(3));          // the paper's recipe, per-step ground-truth scale
  // A drive of that name is not KITTI's sequence.
  EXPECT_THAT(reports("out"), AllOf(HasSubstr("clip 0:30 of 4541"), Not(HasSubstr("476.4"))));
}

TEST_F(Benchmark, ResultsThatAreGoneAreMadeAgain) {
  std::vector<std::string> words = command("out");
  words.insert(words.end(), {"--sequences", "00"});
  ASSERT_EQ(run_stemvo(words).exit_code, 0);
  const fs::path run = folder_ / "out/runs/00/default_camera_height";
  fs::remove(run / "report.html");
  EXPECT_THAT(run_stemvo(words).err, HasSubstr("again: report.html changed"));
  EXPECT_TRUE(fs::exists(run / "report.html"));
}

TEST_F(Benchmark, ABrokenSequenceIsARowAndTheExitCode) {
  fs::remove(kitti_ / "sequences/00/calib.txt");
  fs::remove(kitti_ / "poses/own.txt");
  const ProgramResult result = run_stemvo(command("out"));
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("error: 00: "));
  EXPECT_THAT(reports("out"),
              AllOf(HasSubstr("Not run: "), HasSubstr("calib.txt"), HasSubstr("no ground truth")));
}

}  // namespace
}  // namespace stemvo
