// SPDX-License-Identifier: MIT
#include <chrono>
#include <csignal>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "support/program_test.hpp"
#include "support/tiny_stem.hpp"

namespace stemvo {
namespace {

class Robustness : public ::testing::Test {
 protected:
  [[nodiscard]] ProgramResult run(const std::vector<std::string>& options) const {
    std::vector<std::string> arguments = {"robustness", test::rendered_drive() / "sequences/00",
                                          "--out", folder_ / "out"};
    arguments.insert(arguments.end(), options.begin(), options.end());
    return run_stemvo(arguments);
  }
  [[nodiscard]] std::string out(const std::string& name) const {
    return read_file(folder_ / ("out/" + name));
  }

  TempFolder folder_;
};

TEST_F(Robustness, WritesTableFiguresAndVerdicts) {
  const ProgramResult result = run({"--kinds", "none,sensor_noise,every_nth", "--controls",
                                    "gray,default:2,orb", "--quiet", "--threads", "1"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const std::string table = out("robustness.txt");
  for (const char* word :
       {"default 2", "over gray", "over default:2", "sensor_noise", "every_nth", "all"}) {
    EXPECT_THAT(table, HasSubstr(word));
  }
  const auto json = nlohmann::json::parse(out("robustness.json"));
  ASSERT_EQ(json["rows"].size(), 7U);
  EXPECT_FALSE(json["interrupted"]);
  for (const auto& row : json["rows"]) {
    ASSERT_EQ(row["channels"].size(), 4U);
    // The judged channel against itself: the same run, the same numbers.
    EXPECT_EQ(row["channels"][0]["r_rel_deg_per_100m"], row["channels"][2]["r_rel_deg_per_100m"]);
    EXPECT_EQ(row["channels"][2]["rotation_ratio"]["ratio"], 1.0);
    EXPECT_LE(row["channels"][1]["rotation_ratio"]["low"],
              row["channels"][1]["rotation_ratio"]["ratio"]);
  }
  const auto& undisturbed = json["rows"][0]["channels"];
  EXPECT_LT(undisturbed[0]["t_rel_percent"], 1.0);
  EXPECT_EQ(undisturbed[0]["tracked"], 1.0);
  EXPECT_GT(undisturbed[3]["r_rel_deg_per_100m"], undisturbed[0]["r_rel_deg_per_100m"]);  // ORB
  EXPECT_GT(json["rows"][3]["channels"][0]["r_rel_deg_per_100m"],  // noise of 24 gray levels
            undisturbed[0]["r_rel_deg_per_100m"]);
  EXPECT_THAT(out("report.html"),
              AllOf(HasSubstr("Robustness of "), HasSubstr("sensor_noise"),
                    HasSubstr("--controls gray,default:2,orb"), HasSubstr("max_features: ")));

  const std::string csv = out("robustness.csv");
  EXPECT_EQ(std::ranges::count(csv, '\n'), 1 + 7 * 4);
  ASSERT_EQ(run({"--kinds", "none,sensor_noise,every_nth", "--controls", "gray,default:2,orb",
                 "--threads", "3"})
                .exit_code,
            0);
  EXPECT_EQ(out("robustness.csv"), csv);  // whatever the number of threads
}

TEST_F(Robustness, SaysWhatItCannotDo) {
  expect_error(run({"--kinds", "none,hail"}), 1, {"--kinds", "sensor_noise", "hail"});
  expect_error(run({"--controls", "infrared"}), 1, {"--controls", "census", "infrared"});
  expect_error(run({"--controls", "default:99", "--kinds", "none"}), 1, {"stem.filter", "99"});
  expect_error(run({"--controls", "default:4294967295", "--kinds", "none"}), 1,
               {"--controls", "MODEL:FILTER", "4294967295"});
  expect_error(run({"--controls", "nosuch:1", "--kinds", "none"}), 1, {"stem.model", "nosuch"});
  const std::string same = test::rendered_drive() / "sequences/../sequences/00";
  expect_error(run({same, "--kinds", "none"}), 1, {"expected each sequence once"});
  const fs::path sequence = test::copy_drive(folder_ / "copy", 5);
  fs::remove(folder_ / "copy/poses/00.txt");
  expect_error(run_stemvo({"robustness", sequence, "--out", folder_ / "out"}), 1,
               {"expected ground truth", "found none"});
}

/// A model of one frame size is refused where the frames are cropped: that costs its row alone.
TEST_F(Robustness, ARefusedRunIsAWarning) {
  const std::string drive = folder_ / "tiny";
  ASSERT_EQ(
      run_stemvo({"synth", drive, "--frames", "30", "--width", "48", "--height", "32"}).exit_code,
      0);
  const std::string control = testing::tiny_model("fixed_k4s4") + ":0";
  const ProgramResult result =
      run_stemvo({"robustness", drive + "/sequences/00", "--kinds", "none,cropped", "--controls",
                  control, "--out", folder_ / "out"});
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, HasSubstr("00, cropped 0.6, " + control));
  EXPECT_THAT(result.err, HasSubstr("expected frames of 48x32"));
  const auto json = nlohmann::json::parse(out("robustness.json"));
  ASSERT_EQ(json["rows"].size(), 4U);
  EXPECT_FALSE(json["rows"][0]["channels"][1]["t_rel_percent"].is_null());
  const auto& refused = json["rows"][2]["channels"][1];
  EXPECT_TRUE(refused["t_rel_percent"].is_null());
  EXPECT_TRUE(refused["tracked"].is_null());
  EXPECT_THAT(out("robustness.csv"), HasSubstr("cropped,0.6," + control + ",00,,,,,,\n"));
  EXPECT_TRUE(refused["rotation_ratio"]["high"].is_null());
  EXPECT_FALSE(refused["rotation_ratio"]["decided"]);
}

TEST_F(Robustness, StoppedItWritesTheRowsThatWereFinished) {
  test::RunningProgram program(
      STEMVO_PROGRAM, {"robustness", test::rendered_drive() / "sequences/00", "--controls", "gray",
                       "--out", folder_ / "out"});
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::minutes(2);
  while (out("robustness.csv").empty() && std::chrono::steady_clock::now() < deadline) {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  program.send(SIGINT);
  const ProgramResult result = program.wait();
  EXPECT_EQ(result.exit_code, 130) << result.err;
  EXPECT_THAT(result.err, HasSubstr("rows that were finished are written"));
  const auto json = nlohmann::json::parse(out("robustness.json"));
  EXPECT_TRUE(json["interrupted"]);
  EXPECT_GE(json["rows"].size(), 1U);
  EXPECT_LT(json["rows"].size(), 67U);
}

}  // namespace
}  // namespace stemvo
