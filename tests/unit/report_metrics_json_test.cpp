// SPDX-License-Identifier: MIT
#include <nlohmann/json.hpp>

#include "report/metrics_json.hpp"
#include "support/test.hpp"
#include "text/text_file.hpp"

namespace stemvo {
namespace {

using ::testing::ContainsRegex;

MetricsReport example() {
  Metrics metrics;
  metrics.path_length_m = 145.25;
  metrics.average_offset_m = 1.0 / 3.0;
  metrics.null_offset_m = 79.25;
  metrics.t_rel_percent = 0.97;
  metrics.r_rel_deg_per_100m = 1.72;
  metrics.segment_lengths_m = {100, 200};
  metrics.num_segments = 5;
  metrics.ate_rmse = {4.0, 3.0, 2.0, 1.0};
  metrics.rpe_translation_m = 0.0123;
  metrics.rpe_rotation_deg = 0.0456;
  return {.sequence = "00",
          .first_frame = 20,
          .num_frames = 200,
          .model = "default",
          .filter = 7,
          .fps = 31.5,
          .scale_source = "ground_truth",
          .tracked_fraction = 0.995,
          .num_maps = 2,
          .scale_new_frames = {1, 120},
          .camera = {{700.0, 710.0, 600.5, 180.25, 1241, 376}, CameraSigma{3.5, 0.5, 0.75}},
          .road_measured_fraction = 0.75,
          .road_believed_fraction = 0.875,
          .road_contradicted_fraction = 0.03125,
          .metrics = metrics,
          .map = {},
          .timing = {}};
}

nlohmann::json written(const MetricsReport& report) {
  const TempFolder folder;
  const Status status = write_text_file(folder / "metrics.json", to_text(metrics_document(report)));
  EXPECT_TRUE(status) << status.error().message;
  const std::string text = read_all(folder / "metrics.json");
  EXPECT_TRUE(text.ends_with("}\n"));
  return nlohmann::json::parse(text);
}

TEST(MetricsJson, HoldsEveryKeyAndTheExactNumbers) {
  nlohmann::json json = written(example());
  EXPECT_EQ(json["average_offset_m"].get<double>(), 1.0 / 3.0);
  json.erase("average_offset_m");
  json.erase("stemvo_version");
  EXPECT_EQ(json, nlohmann::json::parse(R"({
      "sequence": "00", "first_frame": 20, "frames": 200,
      "model": "default", "filter": 7, "fps": 31.5, "tracked_fraction": 0.995,
      "scale_source": "ground_truth", "in_place_fraction": 0.0,
      "road_measured_fraction": 0.75, "road_believed_fraction": 0.875,
      "road_contradicted_fraction": 0.03125,
      "maps": 2, "scale_new_frames": [1, 120], "map": null,
      "camera": {"fx_px": 700.0, "fy_px": 710.0, "cx_px": 600.5, "cy_px": 180.25, "k1": 0.0, "k2": 0.0,
                 "fx_sigma_px": 3.5, "cx_sigma_px": 0.5, "cy_sigma_px": 0.75},
      "alignment": "none", "path_length_m": 145.25, "null_offset_m": 79.25,
      "t_rel_percent": 0.97, "r_rel_deg_per_100m": 1.72,
      "segments": 5, "segment_lengths_m": [100.0, 200.0],
      "ate_rmse_m": {"none": 4.0, "scale": 3.0, "se3": 2.0, "sim3": 1.0},
      "rpe_translation_m": 0.0123, "rpe_rotation_deg": 0.0456})"));
}

TEST(MetricsJson, HoldsWhatTheMapMadeOfIt) {
  MetricsReport report = example();
  report.map = {40, 3, 2, 1.5, report.metrics};
  report.map->metrics->t_rel_percent = 0.25;
  const nlohmann::json map = written(report)["map"];
  EXPECT_EQ(map["keyframes"], 40);
  EXPECT_EQ(map["loops"], 3);
  EXPECT_EQ(map["relocalizations"], 2);
  EXPECT_EQ(map["adjustment_s"], 1.5);
  EXPECT_EQ(map["alignment"], "none");
  EXPECT_EQ(map["t_rel_percent"], 0.25);
  EXPECT_EQ(map["ate_rmse_m"]["sim3"], 1.0);
  const std::string table = format_metrics_table(report);
  EXPECT_THAT(table, ContainsRegex("map +40 keyframes, 3 loops, 2 relocalizations, adjusted in 1"));
  EXPECT_THAT(table, ContainsRegex("error +value +map +unit"));
  EXPECT_THAT(table, ContainsRegex("t_rel +0\\.97 +0\\.25  % +none"));
  report.map->metrics.reset();
  EXPECT_TRUE(written(report)["map"]["t_rel_percent"].is_null());
}

TEST(MetricsJson, IsNullWhereGroundTruthIsMissing) {
  MetricsReport report = example();
  report.metrics.reset();
  const nlohmann::json json = written(report);
  for (const char* key : {"alignment", "path_length_m", "average_offset_m", "null_offset_m",
                          "t_rel_percent", "r_rel_deg_per_100m", "segment_lengths_m", "segments",
                          "ate_rmse_m", "rpe_translation_m", "rpe_rotation_deg"}) {
    ASSERT_TRUE(json.contains(key)) << key;
    EXPECT_TRUE(json[key].is_null()) << key;
  }
  EXPECT_EQ(json["frames"], 200);
}

TEST(MetricsJson, IsNullWhereThereIsNoNumber) {
  MetricsReport report = example();
  report.metrics->t_rel_percent.reset();
  report.metrics->average_offset_m = std::numeric_limits<double>::quiet_NaN();
  report.fps = std::numeric_limits<double>::infinity();
  const nlohmann::json json = written(report);
  EXPECT_TRUE(json["t_rel_percent"].is_null());
  EXPECT_TRUE(json["average_offset_m"].is_null());
  EXPECT_TRUE(json["fps"].is_null());
  report.camera.sigma.reset();
  for (const char* key : {"fx_sigma_px", "cx_sigma_px", "cy_sigma_px"}) {
    EXPECT_TRUE(written(report)["camera"].at(key).is_null()) << key;
  }
  report.road_measured_fraction.reset();
  EXPECT_TRUE(written(report)["road_measured_fraction"].is_null());
}

TEST(MetricsJson, SurvivesNamesThatAreNotUtf8) {
  MetricsReport report = example();
  report.sequence = "\xff\"quoted\"";
  EXPECT_THAT(written(report)["sequence"].get<std::string>(), HasSubstr("\"quoted\""));
}

TEST(MetricsTable, SaysWhereARoadWasBelievedNeverOrSeldom) {
  MetricsReport report = example();
  EXPECT_EQ(warn_of_scale(report), "");
  EXPECT_FALSE(report.is_up_to_scale());
  report.scale_source = "camera_height";
  report.road_believed_fraction = 0.125;
  EXPECT_THAT(warn_of_scale(report), HasSubstr("12.5 % of the frames only"));
  EXPECT_FALSE(report.is_up_to_scale());
  report.road_believed_fraction = 0.0;
  EXPECT_THAT(warn_of_scale(report), HasSubstr("in units, not metres"));
  EXPECT_TRUE(report.is_up_to_scale());
  EXPECT_THAT(format_metrics_table(report), HasSubstr("camera_height, no road believed"));
  report.road_believed_fraction.reset();
  EXPECT_EQ(warn_of_scale(report), "");
  report.road_contradicted_fraction = 0.4;
  EXPECT_THAT(warn_of_scale(report), HasSubstr("road and speeds contradict each other on 40.0 %"));
  report.road_contradicted_fraction = 0.0;
  report.metric_fraction = 0.45;
  EXPECT_THAT(warn_of_scale(report), HasSubstr("45.0 % of the frames only are in metres"));
}

TEST(MetricsTable, SaysThatMostOfThePathIsNoMeasurement) {
  MetricsReport report = example();
  EXPECT_EQ(warn_of_gaps(report), "");
  report.tracked_fraction = 0.358;
  EXPECT_THAT(warn_of_gaps(report), HasSubstr("35.8 % of the frames only"));
}

TEST(MetricsTable, NamesTheAlignmentAndTheNullRow) {
  const std::string table = format_metrics_table(example());
  EXPECT_THAT(table, ContainsRegex("t_rel +0\\.97  % +none"));
  EXPECT_THAT(table, ContainsRegex("r_rel +1\\.720  deg/100 m +none"));
  EXPECT_THAT(table, ContainsRegex("average offset +0\\.333  m +none"));
  EXPECT_THAT(table, ContainsRegex("of zero motion +79\\.25  m +none"));
  EXPECT_THAT(table, ContainsRegex("ATE +4\\.00  m +none"));
  EXPECT_THAT(table, ContainsRegex("ATE +3\\.00  m +scale"));
  EXPECT_THAT(table, ContainsRegex("ATE +2\\.00  m +se3"));
  EXPECT_THAT(table, ContainsRegex("ATE +1\\.00  m +sim3"));
  EXPECT_THAT(table, ContainsRegex("translation per frame +0\\.0123  m +none"));
  EXPECT_THAT(table, HasSubstr("mean over 5 segments of 100..200 m"));
  EXPECT_THAT(table, HasSubstr("each step rescaled to its true length"));
  EXPECT_THAT(table, HasSubstr("measured on 75.0 % of the frames"));
  EXPECT_THAT(table, HasSubstr("200 frames (20:220)"));
  EXPECT_THAT(table, HasSubstr("principal point 600.5, 180.2 px, known to 0.5, 0.8 px"));
  EXPECT_THAT(table, HasSubstr("focal length 700.0 px, known to 3.5 px"));
  EXPECT_EQ(table.find(" \n"), std::string::npos) << "blanks at the end of a line";
}

TEST(MetricsTable, NamesTheFitOfATrajectoryWithoutScale) {
  MetricsReport report = example();
  report.scale_source = "none";
  report.metrics->alignment = Alignment::kSim3;
  EXPECT_EQ(written(report)["alignment"], "sim3");
  const std::string table = format_metrics_table(report);
  EXPECT_THAT(table,
              ContainsRegex("scale +none \\(files: up to scale; here: fitted to the true metres"))
      << "as the numbers below have it";
  EXPECT_THAT(table, ContainsRegex("t_rel +0\\.97  % +sim3"));
  EXPECT_THAT(table, ContainsRegex("r_rel +1\\.720  deg/100 m +sim3"));
  EXPECT_THAT(table, ContainsRegex("average offset +0\\.333  m +sim3"));
  EXPECT_THAT(table, ContainsRegex("of zero motion +79\\.25  m +none"));
  EXPECT_THAT(table, ContainsRegex("position ATE +[0-9.]+  m +scale"));
  EXPECT_THAT(table, Not(ContainsRegex("position ATE +[0-9.]+  m +(none|se3)")))
      << "units against metres";
}

}  // namespace
}  // namespace stemvo
