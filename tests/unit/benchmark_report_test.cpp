// SPDX-License-Identifier: MIT
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "benchmark/files.hpp"
#include "benchmark/fingerprint.hpp"
#include "benchmark/official.hpp"
#include "benchmark/published.hpp"
#include "support/temp_folder.hpp"

namespace stemvo::benchmark {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

BenchmarkRun done_run(const std::string& configuration, ScaleProtocol protocol, double t_rel) {
  BenchmarkRun run;
  run.configuration = configuration;
  run.protocol = protocol;
  run.state = BenchmarkState::kDone;
  run.report = MetricsReport{};
  run.report->tracked_fraction = 1.0;
  run.report->fps = 123.456;
  Metrics metrics;
  metrics.path_length_m = 3724.2;
  metrics.average_offset_m = 7.251;
  metrics.null_offset_m = 345.5;
  metrics.t_rel_percent = t_rel;
  metrics.r_rel_deg_per_100m = 0.254;
  metrics.segment_lengths_m = {100, 800};
  metrics.num_segments = 12;
  run.report->metrics = metrics;
  return run;
}

BenchmarkReport report_of_00(bool is_complete) {
  BenchmarkSequence sequence;
  sequence.name = "00";
  sequence.frames = {0, is_complete ? 4541U : 200U};
  sequence.official_frames = 4541;
  sequence.is_complete = is_complete;
  sequence.has_ground_truth = true;
  sequence.runs = {done_run("default", ScaleProtocol::kCameraHeight, 1.17),
                   done_run("paper", ScaleProtocol::kGroundTruthSteps, 94.04)};
  return {"0.1.0+abc", {sequence}, false};
}

TEST(BenchmarkReport, PublishedNumbersStandOnlyBesideAllOfficialFrames) {
  const std::string complete = format_markdown(report_of_00(true));
  EXPECT_THAT(complete,
              AllOf(HasSubstr("all 4541 frames"), HasSubstr("476.40"), HasSubstr("13227.92"),
                    HasSubstr("124361.71"), HasSubstr("11.43"), Not(HasSubstr("clip"))));
  const std::string clip = format_markdown(report_of_00(false));
  EXPECT_THAT(clip, AllOf(HasSubstr("clip 0:200 of 4541"), Not(HasSubstr("476.40")),
                          Not(HasSubstr("11.43")), Not(HasSubstr("all 4541"))));
  const auto published = [](bool is_complete) {
    return nlohmann::json::parse(
               format_json(report_of_00(is_complete)))["sequences"][0]["published"]
        .size();
  };
  EXPECT_GT(published(true), 20U);
  EXPECT_EQ(published(false), 0U);
}

TEST(BenchmarkReport, RowsHoldTheirNumbersAndTheNullRow) {
  const std::string text = format_markdown(report_of_00(false));
  EXPECT_THAT(text, HasSubstr("| default, camera height | 1.17 / 0.25 / 7.25 |\n"));
  EXPECT_THAT(text, HasSubstr("| paper, true steps | 94.04 / 0.25 / 7.25 |\n"));
  EXPECT_THAT(text, HasSubstr("| never moving | - / - / 345.50 |\n"));
  EXPECT_THAT(text, HasSubstr("| default | camera height | none | 1.17 | 0.254 | 7.25 |"));
  const auto json = nlohmann::json::parse(format_json(report_of_00(false)));
  EXPECT_EQ(json["sequences"][0]["runs"][1]["t_rel_percent"], 94.04);
  EXPECT_EQ(json["sequences"][0]["never_moving"]["average_offset_m"], 345.5);
  // No times where reports are compared.
  EXPECT_THAT(text + json.dump(), Not(HasSubstr("123.4")));
  EXPECT_THAT(format_speed_json(report_of_00(false)), HasSubstr("123.4"));
}

TEST(BenchmarkReport, FailuresAndGapsAreRowsWithTheirReason) {
  BenchmarkReport report = report_of_00(false);
  report.sequences[0].runs[0].state = BenchmarkState::kFailed;
  report.sequences[0].runs[0].report.reset();
  report.sequences[0].runs[0].problem = "calib.txt: expected | a row";
  BenchmarkSequence broken;
  broken.name = "broken";
  broken.problem = "image_0: none";
  report.sequences.push_back(broken);
  BenchmarkSequence blind;  // no ground truth
  blind.name = "11";
  blind.frames = {0, 50};
  blind.runs = {done_run("default", ScaleProtocol::kCameraHeight, 1.0), BenchmarkRun{}};
  blind.runs[0].report->metrics.reset();
  blind.runs[1].state = BenchmarkState::kNotPossible;
  blind.runs[1].problem = "no ground truth";
  report.sequences.push_back(blind);
  EXPECT_TRUE(has_failures(report));
  const std::string text = format_markdown(report);
  EXPECT_THAT(text, HasSubstr("| default, camera height | failed | - |\n"));
  EXPECT_THAT(text, HasSubstr("| - | - | - | - | calib.txt: expected \\| a row |\n"));
  EXPECT_THAT(text, HasSubstr("## broken\n\nNot run: image_0: none\n"));
  EXPECT_THAT(text, HasSubstr("100.0 % of the frames measured; no ground truth |\n"));
  report.sequences[0].runs[0].state = BenchmarkState::kDone;
  report.sequences.erase(report.sequences.begin() + 1);
  EXPECT_FALSE(has_failures(report));  // no ground truth is no failure
}

TEST(BenchmarkPublished, EachRowHasANumberItsAlignmentAndItsSource) {
  for (const char* name : {"00", "01", "02", "03", "04", "05", "06", "07", "08", "09", "10"}) {
    const auto rows = published_numbers(name);
    EXPECT_GT(rows.size(), 10U) << name;
    for (const PublishedNumbers& row : rows) {
      EXPECT_TRUE(row.t_rel_percent || row.average_offset_m || row.ate_rmse_m) << row.method;
      EXPECT_THAT(row.alignment, Not(IsEmpty())) << row.method;
      EXPECT_THAT(row.source, Not(IsEmpty())) << row.method;
      for (const auto& value :
           {row.t_rel_percent, row.r_rel_deg_per_100m, row.average_offset_m, row.ate_rmse_m}) {
        EXPECT_TRUE(!value || *value > 0.0) << row.method;
      }
    }
  }
  EXPECT_EQ(published_numbers("00").front().average_offset_m, 476.40);
  EXPECT_EQ(published_numbers("09").front().average_offset_m, 536.42);
  EXPECT_THAT(published_numbers("11"), IsEmpty());
  EXPECT_THAT(published_numbers("0"), IsEmpty());
}

/// All 271 frames of 04 in size, number and length, all of them black.
class OfficialFrames : public ::testing::Test {
 protected:
  void write(int num_frames, const cv::Size& size, double length_m) {
    fs::remove_all(sequence_);
    fs::create_directories(sequence_ / "image_0");
    fs::create_directories(folder_ / "poses");
    std::ofstream(sequence_ / "calib.txt") << "P0: 707 0 601 0 0 707 183 0 0 0 1 0\n";
    std::ofstream times(sequence_ / "times.txt");
    std::ofstream poses(folder_ / "poses/04.txt");
    for (int i = 0; i < num_frames; ++i) {
      times << 0.1 * i << '\n';
      poses << fmt::format("1 0 0 0 0 1 0 0 0 0 1 {}\n", length_m * i / (num_frames - 1));
      const fs::path file = sequence_ / fmt::format("image_0/{:06}.png", i);
      if (i == 0) {
        cv::imwrite(file.string(), cv::Mat::zeros(size, CV_8UC1));
      } else {
        fs::create_hard_link(sequence_ / "image_0/000000.png", file);
      }
    }
  }
  [[nodiscard]] bool is_official_04() const {
    const auto sequence = KittiSequence::open(sequence_);
    EXPECT_TRUE(sequence) << sequence.error().message;
    return sequence && is_official(*find_official("04"), *sequence);
  }

  testing::TempFolder folder_;
  fs::path sequence_ = folder_ / "sequences/04";
};

TEST_F(OfficialFrames, AreKnownByNumberSizeAndLength) {
  write(271, {1226, 370}, 393.6);
  EXPECT_TRUE(is_official_04());
  write(270, {1226, 370}, 393.6);
  EXPECT_FALSE(is_official_04());
  write(271, {613, 185}, 393.6);
  EXPECT_FALSE(is_official_04());
  write(271, {1226, 370}, 380.0);
  EXPECT_FALSE(is_official_04());
  fs::remove(folder_ / "poses/04.txt");
  EXPECT_FALSE(is_official_04());
  EXPECT_FALSE(find_official("drive"));
}

TEST(BenchmarkFingerprint, ChangesAreNamed) {
  const Fingerprint before = {"a", "b", "c", "d", "e", "f"};
  EXPECT_THAT(describe_change(before, before), IsEmpty());
  Fingerprint now = before;
  now.configuration = "x";
  now.frames = "y";
  EXPECT_EQ(describe_change(before, now), "the configuration and the frames changed");
  const testing::TempFolder folder;
  ASSERT_TRUE(write_fingerprint(folder.path(), before));
  EXPECT_TRUE(*read_fingerprint(folder.path()) == before);
  remove_fingerprint(folder.path());
  EXPECT_FALSE(read_fingerprint(folder.path()));
  (void)folder.file("benchmark_inputs.json", "{\"configuration\": 3");
  EXPECT_FALSE(read_fingerprint(folder.path()));
}

}  // namespace
}  // namespace stemvo::benchmark
