// SPDX-License-Identifier: MIT
// A whole search in this process, under the sanitizers too.
#include <algorithm>
#include <string>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "search/search.hpp"
#include "support/small_drive.hpp"

namespace stemvo::search {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::read_all;

class SearchRun : public testing::SmallDrive {
 protected:
  [[nodiscard]] SearchRequest request(const std::string& out) const {
    SearchRequest request;
    request.sequence_dirs = {sequence_};
    request.out_dir = folder_ / out;
    request.filters = FrameRangeRequest{0, 4};
    request.config.evaluation.segment_lengths_m = {2.0, 4.0};
    request.exhaustive = true;
    request.num_threads = 2;
    return request;
  }
  [[nodiscard]] std::string table(const std::string& out) const {
    return read_all(folder_ / out / "filters.csv");
  }
  [[nodiscard]] static std::string error_of(const SearchRequest& request) {
    const auto report = run_search(request);
    return report ? "no error" : report.error().message;
  }
};

TEST_F(SearchRun, RanksEveryFilterWhateverTheThreads) {
  SearchRequest one = request("one");
  one.num_threads = 1;
  const auto report = run_search(one);
  ASSERT_TRUE(report) << report.error().message;
  EXPECT_FALSE(report->interrupted);
  EXPECT_TRUE(report->warnings.empty());
  EXPECT_THAT(report->text, AllOf(HasSubstr("default"), HasSubstr("t_rel"),
                                  HasSubstr("cannot be told from the best")));
  const auto json = nlohmann::json::parse(report->json);
  EXPECT_TRUE(json["complete"].get<bool>());
  EXPECT_EQ(json["filters"].size(), 8U);  // and ORB, R, G, B
  for (const char* name :
       {"filters.json", "config.yaml", "best.yaml", "report.html", "sheet.png", "records.jsonl"}) {
    EXPECT_TRUE(fs::exists(one.out_dir / name)) << name;
  }
  SearchRequest blocks = request("blocks");
  blocks.num_threads = 3;
  blocks.block = 3;
  ASSERT_TRUE(run_search(blocks));
  EXPECT_EQ(table("blocks"), table("one"));
}

TEST_F(SearchRun, SaysThatAPathIsTooShortForIntervals) {
  SearchRequest brief = request("brief");
  brief.frames = FrameRangeRequest{0, 5};
  const auto report = run_search(brief);
  ASSERT_TRUE(report) << report.error().message;
  EXPECT_THAT(report->text, AllOf(HasSubstr("too short for 95 % intervals"),
                                  Not(HasSubstr("cannot be told from the best"))));
}

TEST_F(SearchRun, HalvingStoppedAndGoneOnGivesTheSameTable) {
  SearchRequest whole = request("whole");
  whole.exhaustive = false;
  whole.filters.reset();
  ASSERT_TRUE(render_synthetic_drive(
      folder_.path(),
      {.num_frames = 12, .seed = 2, .width_px = 310, .height_px = 94, .name = "01"}));
  whole.held_out_dir = folder_ / "sequences/01";
  const auto report = run_search(whole);
  ASSERT_TRUE(report) << report.error().message;

  SearchRequest stopped = whole;
  stopped.out_dir = folder_ / "stopped";
  stopped.block = 4;
  const auto part = run_search(stopped, [](std::size_t done, std::size_t) { return done < 40; });
  ASSERT_TRUE(part) << part.error().message;
  EXPECT_TRUE(part->interrupted);
  EXPECT_NE(table("stopped"), table("whole"));
  EXPECT_THAT(error_of(stopped), HasSubstr("--resume goes on with it"));
  stopped.resume = true;
  const auto all = run_search(stopped);
  ASSERT_TRUE(all) << all.error().message;
  EXPECT_FALSE(all->interrupted);
  EXPECT_EQ(table("stopped"), table("whole"));
  stopped.config.seed = 2;
  EXPECT_THAT(error_of(stopped), HasSubstr("seed"));
}

TEST_F(SearchRun, PartsMergedAreTheWhole) {
  ASSERT_TRUE(run_search(request("whole")));
  SearchRequest first = request("first");
  first.filters = FrameRangeRequest{0, 1};
  SearchRequest second = request("second");
  second.filters = FrameRangeRequest{1, 4};
  second.baselines = false;
  ASSERT_TRUE(run_search(first));
  const auto merge = [&] {
    return merge_searches({folder_ / "first", folder_ / "second"}, folder_ / "merged");
  };
  EXPECT_FALSE(merge()) << "a part that was not run";
  ASSERT_TRUE(run_search(second));
  const auto merged = merge();
  ASSERT_TRUE(merged) << merged.error().message;
  EXPECT_EQ(table("merged"), table("whole"));
}

TEST_F(SearchRun, DisturbedFramesRankToo) {
  SearchRequest disturbed = request("out");
  disturbed.kinds = {"sensor_noise"};
  disturbed.filters = FrameRangeRequest{0, 1};
  const auto report = run_search(disturbed);
  ASSERT_TRUE(report) << report.error().message;
  EXPECT_THAT(table("out"), HasSubstr("sensor_noise"));
}

TEST_F(SearchRun, WhatIsWrongIsSaidBeforeWorkStarts) {
  SearchRequest wrong = request("out");
  wrong.models = {"nosuch"};
  EXPECT_THAT(error_of(wrong), HasSubstr("nosuch"));
  wrong = request("out");
  wrong.models = {"gray", "gray"};
  EXPECT_THAT(error_of(wrong), HasSubstr("expected each name once"));
  wrong = request("out");
  wrong.filters = FrameRangeRequest{0, 500};
  EXPECT_THAT(error_of(wrong), HasSubstr("500"));
  wrong = request("out");
  wrong.kinds = {"hail"};
  EXPECT_THAT(error_of(wrong), HasSubstr("hail"));
  wrong = request("out");
  wrong.config.evaluation.segment_lengths_m = {800.0};
  EXPECT_THAT(error_of(wrong), HasSubstr("800"));
  EXPECT_FALSE(fs::exists(folder_ / "out"));
  fs::remove(folder_ / "poses/00.txt");
  EXPECT_THAT(error_of(request("out")), HasSubstr("expected a pose file"));
}

/// A frame that cannot be read is a warning; every filter has a row.
TEST_F(SearchRun, ABrokenFrameIsAWarning) {
  fs::resize_file(sequence_ / "image_2/000007.png", 50);
  const auto report = run_search(request("out"));
  ASSERT_TRUE(report) << report.error().message;
  ASSERT_EQ(report->warnings.size(), 1U);
  EXPECT_THAT(report->warnings[0], HasSubstr("000007.png"));
  EXPECT_EQ(std::ranges::count(table("out"), '\n'), 1 + 8);
}

}  // namespace
}  // namespace stemvo::search
