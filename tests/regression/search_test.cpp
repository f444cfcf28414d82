// SPDX-License-Identifier: MIT
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "support/search_program.hpp"
#include "support/temp_folder.hpp"
#include "support/tiny_stem.hpp"

namespace stemvo {
namespace {

/// Models of 3 filters (layer `stem`) and of 2 (layer `deep`).
const std::string kTwoLayers =
    testing::tiny_model("plain_k4s4") + "," + testing::tiny_model("deep_k12s4");

TEST_F(Search, PartsMergedAreTheWholeAndTheBestCanBeRun) {
  ASSERT_EQ(search("whole", {"--exhaustive", "--filters", "0:3"}).exit_code, 0);
  ASSERT_EQ(search("a", {"--exhaustive", "--filters", "0:1"}).exit_code, 0);
  ASSERT_EQ(search("b", {"--exhaustive", "--filters", "1:3", "--no-baselines"}).exit_code, 0);
  const ProgramResult merged =
      run_stemvo({"search", "--merge", folder_ / "b", folder_ / "a", "--out", folder_ / "merged"});
  ASSERT_EQ(merged.exit_code, 0) << merged.err;
  EXPECT_EQ(table("merged"), table("whole"));
  EXPECT_EQ(read_file(folder_ / "merged/filters.json"), read_file(folder_ / "whole/filters.json"));
  EXPECT_TRUE(fs::exists(folder_ / "merged/sheet.png"));
  // As a kill in the middle leaves it, and from the end.
  const fs::path records = folder_ / "merged/records.jsonl";
  const std::string joined = read_file(records);
  for (const std::size_t size : {joined.size() * 2 / 3, joined.find('\n') / 2, joined.size()}) {
    write_file(records, joined.substr(0, size));
    fs::remove(folder_ / "merged/filters.csv");
    ASSERT_EQ(
        run_stemvo({"search", "--merge", folder_ / "b", folder_ / "a", "--out", folder_ / "merged"})
            .exit_code,
        0);
    EXPECT_TRUE(read_file(records) == joined) << size;
    EXPECT_EQ(table("merged"), table("whole"));
  }
  const std::string part = read_file(folder_ / "a/records.jsonl");
  expect_error(
      run_stemvo({"search", "--merge", folder_ / "b", folder_ / "a", "--out", folder_ / "a"}), 1,
      {"a/records.jsonl", "no input"});
  EXPECT_TRUE(read_file(folder_ / "a/records.jsonl") == part);
  const ProgramResult run =
      run_stemvo({"run", sequence_.string(), "--config", folder_ / "whole/best.yaml", "--out",
                  folder_ / "run", "--quiet"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const auto metrics = nlohmann::json::parse(read_file(folder_ / "run/metrics.json"));
  const auto filters = nlohmann::json::parse(read_file(folder_ / "whole/filters.json"));
  ASSERT_EQ(filters["filters"].size(), 7U);
  EXPECT_EQ(metrics["t_rel_percent"], filters["filters"][0]["t_rel_percent"]);
  EXPECT_EQ(metrics["filter"], filters["filters"][0]["filter"]);
  EXPECT_LT(metrics["t_rel_percent"].get<double>(), 10.0);
  EXPECT_EQ(filters["work"]["filter_frames"], 3 * 30);
  EXPECT_EQ(filters["work"]["exhaustive_filter_frames"], 3 * 30);
  EXPECT_EQ(filters["work"]["baseline_filter_frames"], 4 * 30);
}

/// Filters 0:1 and 1:3, each on two sequences that rank and one that is held out.
TEST_F(Search, PartsByFilterAndSequenceMergedAreTheWhole) {
  const std::string first = sequence_.string();
  copy_sequence("second");
  const Words asked = {first,   "--frames",
                       "0:20",  "--held-out",
                       first,   "--held-out-frames",
                       "20:30", "--exhaustive",
                       "--set", "evaluation.segment_lengths_m=[5]"};
  const auto search_part = [&](const std::string& out, const Words& more) {
    Words words = asked;
    words.insert(words.end(), more.begin(), more.end());
    return search(out, words);
  };
  ASSERT_EQ(search_part("whole", {"--filters", "0:3"}).exit_code, 0);
  Words merge = {"search", "--out", folder_ / "merged", "--merge"};
  for (const std::string sequence : {"2", "0", "1"}) {
    const ProgramResult one = search_part(
        "a" + sequence, {"--filters", "0:1", "--only-sequence", sequence, "--no-baselines"});
    ASSERT_EQ(one.exit_code, 0) << one.err;
    ASSERT_EQ(
        search_part("b" + sequence, {"--filters", "1:3", "--only-sequence", sequence}).exit_code,
        0);
    EXPECT_FALSE(fs::exists(folder_ / ("a" + sequence + "/filters.csv")));  // a part ranks nothing
    merge.insert(merge.end(), {folder_ / ("b" + sequence), folder_ / ("a" + sequence)});
  }
  const ProgramResult merged = run_stemvo(merge);
  ASSERT_EQ(merged.exit_code, 0) << merged.err;
  EXPECT_THAT(table("merged"),
              HasSubstr(",t_rel_percent_second,r_rel_deg_per_100m_second,t_rel_percent_00,"));
  EXPECT_THAT(table("merged"), HasSubstr(",held_out_t_rel_percent,"));
  EXPECT_EQ(table("merged"), table("whole"));
  EXPECT_EQ(read_file(folder_ / "merged/filters.json"), read_file(folder_ / "whole/filters.json"));

  merge[2] = folder_ / "less";
  merge.pop_back();
  EXPECT_THAT(run_stemvo(merge).err,
              HasSubstr("expected a part with default stem 0 on 00, found none"));
  EXPECT_THAT(
      search_part("a0", {"--filters", "0:1", "--only-sequence", "1", "--no-baselines", "--resume"})
          .err,
      HasSubstr("--only-sequence (0, now 1) changed"));
  EXPECT_THAT(search_part("wrong", {"--only-sequence", "3"}).err,
              HasSubstr("--only-sequence: expected 0 to 2, the held-out one last, found 3"));
  EXPECT_THAT(search("wrong", {"--only-sequence", "0"}).err, HasSubstr("expected --exhaustive"));
}

TEST_F(Search, LayersAndTheHeldOutSequence) {
  const std::string models = kTwoLayers;
  copy_sequence("01");
  const fs::path held_out = sequence_;
  sequence_ = test::rendered_drive(kSize) / "sequences/00";
  const Words asked = {"--model",           models,       "--exhaustive",
                       "--no-baselines",    "--held-out", held_out.string(),
                       "--held-out-frames", "5:30"};
  ASSERT_EQ(search("both", asked).exit_code, 0);
  const auto both = nlohmann::json::parse(read_file(folder_ / "both/filters.json"));
  ASSERT_EQ(both["filters"].size(), 5U);  // 3 of `stem`, 2 of `deep`
  EXPECT_EQ(both["work"]["filter_frames"], 5 * 30);
  EXPECT_EQ(both["work"]["held_out_filter_frames"], 5 * 25);
  for (const auto& filter : both["filters"]) {
    EXPECT_EQ(filter["held_out"]["frames"], 25);
    EXPECT_EQ(filter["sequences"].size(), 1U);  // the held-out one ranks nothing
  }
  EXPECT_THAT(table("both"), HasSubstr(",frames,held_out_t_rel_percent,"));
  Words deep = asked;
  deep[1] = testing::tiny_model("deep_k12s4");
  ASSERT_EQ(search("deep", deep).exit_code, 0);
  EXPECT_EQ(count_lines(folder_ / "deep/filters.csv"), 3U);
  EXPECT_THAT(table("deep"),
              AllOf(HasSubstr("deep_k12s4,deep,0,"), HasSubstr("deep_k12s4,deep,1,")));
}

TEST_F(Search, TooSmallAChannelIsARowWithItsReason) {
  const fs::path small =
      test::rendered_drive({.frames = 30, .width_px = 160, .height_px = 48}) / "sequences/00";
  const ProgramResult program =
      run_stemvo({"search", small.string(), "--exhaustive", "--no-baselines", "--model", "paper",
                  "--filters", "0:2", "--set", "stem.sampling_px=4", "--set",
                  "stem.tracking_resolution=input", "--out", folder_ / "small"});
  ASSERT_EQ(program.exit_code, 0) << program.err;
  EXPECT_THAT(program.out, AllOf(HasSubstr("not detected"), HasSubstr("channel 40x12")));
  // It never ran, so there are no numbers that could look good.
  EXPECT_THAT(table("small"),
              HasSubstr("\npaper,stem,0,patch,not detected,,,,,,,,,,,,0,channel 40x12"));
  const auto drive = result("small")["filters"][0]["sequences"][0];
  for (const char* key : {"t_rel_percent", "r_rel_deg_per_100m", "average_offset_m", "E_t_m",
                          "E_r_deg", "inliers", "tracked", "early_error_percent"}) {
    EXPECT_TRUE(drive.at(key).is_null()) << key;
  }
}

TEST_F(Search, DisturbedSequencesRankBesideThem) {
  const fs::path small =
      test::rendered_drive({.frames = 30, .width_px = 160, .height_px = 48}) / "sequences/00";
  const Words asked = {"search",  small.string(), "--exhaustive", "--filters", "0:3",
                       "--kinds", "dusk,dropped", "--quiet",      "--out"};
  const auto run = [&](const std::string& name, const Words& more = {}) {
    Words words = asked;
    words.push_back(folder_ / name);
    words.insert(words.end(), more.begin(), more.end());
    return run_stemvo(words);
  };
  ASSERT_EQ(run("all").exit_code, 0);
  const auto all = result("all");
  ASSERT_EQ(all["sequences"].size(), 3U);
  EXPECT_EQ(all["sequences"][1]["name"], "00_dusk_0.03");
  EXPECT_EQ(all["sequences"][1]["frames"], 30);
  EXPECT_EQ(all["sequences"][2]["name"], "00_dropped_0.1");
  EXPECT_LT(all["sequences"][2]["frames"], 30);
  EXPECT_THAT(table("all"), HasSubstr("t_rel_percent_00_dusk_0.03"));
  const auto& best = all["filters"][0];
  EXPECT_EQ(best["equal"], true);
  EXPECT_NE(best["sequences"][0]["inliers"], best["sequences"][1]["inliers"]);
  // In parts, as one.
  for (const std::string part : {"0", "1", "2"}) {
    ASSERT_EQ(run(part, {"--only-sequence", part}).exit_code, 0);
  }
  ASSERT_EQ(run_stemvo({"search", "--merge", folder_ / "0", folder_ / "1", folder_ / "2", "--out",
                        folder_ / "merged", "--quiet"})
                .exit_code,
            0);
  EXPECT_EQ(table("merged"), table("all"));
  expect_error(run("bad", {"--kinds", "hail"}), 1, {"--kinds", "sensor_noise", "'hail'"});
}

/// 2 of 5 filters (layer `deep`) are too small: neither the work nor the race counts them.
TEST_F(Search, WhatCannotRunIsNoPartOfTheRaceAndBaselinesRunToTheEnd) {
  const fs::path small =
      test::rendered_drive({.frames = 30, .width_px = 160, .height_px = 48}) / "sequences/00";
  const Words asked = {"search", small.string(), "--model", kTwoLayers, "--quiet", "--out"};
  const auto run = [&](const std::string& out, const Words& more) {
    Words words = asked;
    words.push_back(folder_ / out);
    words.insert(words.end(), more.begin(), more.end());
    const ProgramResult program = run_stemvo(words);
    EXPECT_EQ(program.exit_code, 0) << program.err;
    return result(out);
  };
  const auto all = run("all", {"--exhaustive"});
  EXPECT_EQ(all["work"]["filter_frames"], 3 * 30);
  EXPECT_EQ(all["work"]["exhaustive_filter_frames"], 3 * 30);
  const auto halved = run("halved", {});
  EXPECT_TRUE(halved["complete"].get<bool>());
  EXPECT_EQ(halved["rungs"][0]["filters"], 3);
  EXPECT_EQ(halved["work"]["exhaustive_filter_frames"], 3 * 30);
  EXPECT_EQ(halved["work"]["baseline_filter_frames"], 4 * 30);
  EXPECT_LT(halved["work"]["filter_frames"].get<int>(), 3 * 30);
  int baselines = 0;
  for (const auto& row : halved["filters"]) {
    const bool is_baseline = row["layer"] == "input";
    baselines += is_baseline ? 1 : 0;
    EXPECT_TRUE(!is_baseline || row["sequences"][0]["frames"] == 30) << row;
    EXPECT_TRUE(row["layer"] != "deep" || row["status"] == "not detected") << row;
  }
  EXPECT_EQ(baselines, 4);
}

}  // namespace
}  // namespace stemvo
