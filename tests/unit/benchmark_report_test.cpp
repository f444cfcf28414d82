// SPDX-License-Identifier: MIT
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "benchmark/benchmark.hpp"
#include "report/metrics_keys.hpp"
#include "support/temp_folder.hpp"

namespace stemvo::benchmark {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using Json = nlohmann::ordered_json;

Json done_run(const std::string& configuration, const std::string& scale_source, double t_rel) {
  Metrics metrics;
  metrics.path_length_m = 3724.2;
  metrics.average_offset_m = 7.251;
  metrics.null_offset_m = 345.5;
  metrics.t_rel_percent = t_rel;
  metrics.r_rel_deg_per_100m = 0.254;
  metrics.segment_lengths_m = {100, 800};
  metrics.num_segments = 12;
  Json run = {{"configuration", configuration},
              {"scale_source", scale_source},
              {"alignment", "none"},
              {"state", "done"},
              {"problem", nullptr},
              {"tracked_fraction", 1.0}};
  add_metrics(run, metrics);
  return run;
}

/// As benchmark.json has it.
Json sequence(const std::string& name, const Json& runs) {
  return {{"name", name},
          {"problem", nullptr},
          {"first_frame", 0},
          {"frames", 200},
          {"official_frames", nullptr},
          {"is_complete", false},
          {"runs", runs},
          {"zero_motion", {{"average_offset_m", 345.5}}},
          {"published", Json::array()}};
}

Json report_of_00() {
  Json clip = sequence("00", Json::array({done_run("default", "camera_height", 1.17),
                                          done_run("paper", "ground_truth", 94.04)}));
  clip["official_frames"] = 4541;
  return {
      {"stemvo_version", "0.1.0+abc"}, {"interrupted", false}, {"sequences", Json::array({clip})}};
}

TEST(BenchmarkReport, RowsHoldTheirNumbersAndTheBaseline) {
  const std::string text = format_markdown(report_of_00());
  EXPECT_THAT(text, HasSubstr("stemvo 0.1.0+abc. "));
  EXPECT_THAT(text, HasSubstr("clip 0:200 of 4541, 3724 m; 12 segments of 100..800 m.\n"));
  EXPECT_THAT(text, HasSubstr("| default, camera height | 1.17 / 0.25 / 7.25 |\n"));
  EXPECT_THAT(text, HasSubstr("| paper, per-step ground-truth scale | 94.04 / 0.25 / 7.25 |\n"));
  EXPECT_THAT(text, HasSubstr("| zero motion | - / - / 345.50 |\n"));
  EXPECT_THAT(text, HasSubstr("| default | camera height | none | 1.17 | 0.254 | 7.25 |"));
  EXPECT_THAT(text, HasSubstr("| zero motion | - | none | - | - | 345.50 | - |  |\n"));
  EXPECT_THAT(text, HasSubstr("Published numbers are of all official frames"));
}

TEST(BenchmarkReport, FailuresAndGapsAreRowsWithTheirReason) {
  Json report = report_of_00();
  Json failed = done_run("default", "camera_height", 1.0);
  failed["state"] = "failed";
  failed["problem"] = "calib.txt: expected | a row";
  failed["tracked_fraction"] = nullptr;
  add_metrics(failed, std::nullopt);
  report["sequences"][0]["runs"][0] = failed;
  Json broken = sequence("broken", Json::array());
  broken["problem"] = "image_0: none";
  Json blind = sequence("11", Json::array({done_run("default", "camera_height", 1.0), failed}));
  add_metrics(blind["runs"][0], std::nullopt);  // no ground truth
  blind["runs"][1]["state"] = "not possible";
  blind["runs"][1]["problem"] = "no ground truth";
  report["sequences"].push_back(broken);
  report["sequences"].push_back(blind);
  const std::string text = format_markdown(report);
  EXPECT_THAT(text, HasSubstr("| default, camera height | failed | - |\n"));
  EXPECT_THAT(text, HasSubstr("| - | - | - | - | calib.txt: expected \\| a row |\n"));
  EXPECT_THAT(text, HasSubstr("## broken\n\nNot run: image_0: none\n"));
  EXPECT_THAT(text, HasSubstr("100.0 % of the frames measured; no ground truth |\n"));
  EXPECT_THAT(text, HasSubstr("## 11\n\nframes 0:200.\n"));
}

TEST(BenchmarkPublished, EachRowHasANumberItsAlignmentAndItsSource) {
  const Json published =
      Json::parse(testing::read_all(STEMVO_SOURCE_DIR "/config/published.json"), nullptr, true,
                  /*ignore_comments=*/true);
  EXPECT_EQ(published["sequences"].size(), 11U);
  for (const auto& [name, sequence] : published["sequences"].items()) {
    for (const char* key : {"frames", "length_m", "width_px", "height_px"}) {
      EXPECT_GT(sequence.at(key).get<int>(), 0) << name;
    }
    int num_rows = 0;
    for (const Json& row : published["published"]) {
      num_rows += row["t_rel_percent"].contains(name) || row["average_offset_m"].contains(name) ||
                          row["ate_rmse_m"].contains(name)
                      ? 1
                      : 0;
    }
    EXPECT_GT(num_rows, 10) << name;
  }
  for (const Json& row : published["published"]) {
    for (const char* key : {"method", "scale_source", "alignment", "source"}) {
      EXPECT_THAT(row.at(key).get<std::string>(), Not(IsEmpty())) << row;
    }
    for (const char* key :
         {"t_rel_percent", "r_rel_deg_per_100m", "average_offset_m", "ate_rmse_m"}) {
      for (const auto& [name, number] : row.at(key).items()) {
        EXPECT_TRUE(published["sequences"].contains(name)) << row;
        EXPECT_GT(number.get<double>(), 0.0) << row;
      }
    }
  }
  const Json& paper = published["published"][0]["average_offset_m"];
  EXPECT_EQ(paper["00"], 476.40);
  EXPECT_EQ(paper["09"], 536.42);
}

}  // namespace
}  // namespace stemvo::benchmark
