// SPDX-License-Identifier: MIT
#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "search/race.hpp"
#include "support/search_program.hpp"

namespace stemvo::search {
namespace {

/// The default model's 16 filters on a small drive, halved.
class SearchRace : public Search {
 protected:
  struct Outcome {
    std::string table;
    std::size_t filter_frames = 0;
    bool was_stopped = false;
  };

  SearchRace() {
    request_.sequence_dirs = {sequence_};
    request_.baselines = false;
    request_.block = 3;
  }

  /// Goes on from what `out` holds. Stops after so many filter-frames of this call.
  [[nodiscard]] Outcome race(const std::string& out,
                             std::size_t max_kept,
                             std::size_t max_frames = SIZE_MAX) const {
    const auto plan = make_plan(request_);
    EXPECT_TRUE(plan) << plan.error().message;
    auto file = RecordFile::open(folder_ / (out + ".jsonl"), plan->identity, true);
    EXPECT_TRUE(file) << file.error().message;
    std::size_t done_before = SIZE_MAX;
    const auto progress = [&](std::size_t done, std::size_t) {
      done_before = std::min(done_before, done);
      return done - done_before < max_frames;
    };
    EXPECT_TRUE(run_race(*plan, progress, *file, max_kept));
    const FilterRecords& records = file->records();
    Outcome outcome;
    outcome.table = format_csv(plan->identity, rank_filters(plan->identity, records));
    for (const FilterRecord& record : records) {
      outcome.filter_frames += record.filter_frames;
    }
    const std::size_t last = plan->identity.rungs.size() - 1;
    outcome.was_stopped =
        std::none_of(records.begin(), records.end(),
                     [last](const FilterRecord& record) { return record.rung == last; });
    return outcome;
  }

  SearchRequest request_;
};

TEST_F(SearchRace, RecordsThatCannotBeWrittenEndItWithTablesOfThoseThatWere) {
  request_.exhaustive = true;
  request_.block = 5;
  request_.out_dir = folder_ / "full";
  const auto report = run_search(request_, [&](std::size_t done, std::size_t) {
    if (done > 5 * 30) {  // in the second block: as large as it may be
      fs::resize_file(request_.out_dir / kRecordsFile, std::uintmax_t{kMaxRecords_MB} * 1000000);
    }
    return true;
  });
  ASSERT_FALSE(report);
  EXPECT_THAT(report.error().message, HasSubstr("records.jsonl: expected at most 512 MB"));
  EXPECT_THAT(table("full"), HasSubstr("default,stem,4"));
  EXPECT_THAT(table("full"), Not(HasSubstr("default,stem,5")));
}

/// A frame that is done is one call of the progress, and one pass of the stem.
TEST_F(SearchRace, OnePassServesAllFiltersUnlessABlockIsAskedFor) {
  request_.exhaustive = true;
  const auto num_passes = [&](const std::string& out, int block) {
    request_.block = block;
    request_.out_dir = folder_ / out;
    std::size_t calls = 0;
    const auto report = run_search(request_, [&](std::size_t, std::size_t) { return ++calls > 0; });
    EXPECT_TRUE(report) << report.error().message;
    return calls;
  };
  EXPECT_EQ(num_passes("whole", SearchRequest().block), 30U);
  EXPECT_EQ(num_passes("four", 5), 4 * 30U);
  EXPECT_EQ(table("four"), table("whole"));
}

TEST_F(SearchRace, HoweverManyAreKeptInMemoryTheTableIsTheSame) {
  const Outcome all = race("all", kMaxKept);
  ASSERT_NE(all.table.find(",stopped,"), std::string::npos);
  std::size_t more_work = all.filter_frames;
  // The fewer are kept the more start again.
  for (const std::size_t max_kept : {5U, 2U, 0U}) {
    const Outcome some = race("kept" + std::to_string(max_kept), max_kept);
    EXPECT_EQ(some.table, all.table) << max_kept;
    EXPECT_GE(some.filter_frames, more_work) << max_kept;
    more_work = some.filter_frames;
  }
  EXPECT_GT(more_work, all.filter_frames);
}

TEST_F(SearchRace, StoppedAndGoneOnWithHalvingGivesTheSameTable) {
  const Outcome whole = race("whole", kMaxKept);
  for (const std::size_t max_kept : {kMaxKept, std::size_t{2}}) {
    const std::string name = "stopped" + std::to_string(max_kept);
    EXPECT_TRUE(race(name, max_kept, 70).was_stopped);  // in the third of five rungs
    EXPECT_TRUE(race(name, max_kept, 20).was_stopped);
    const Outcome gone_on = race(name, max_kept);
    EXPECT_EQ(gone_on.table, whole.table);
    EXPECT_GT(gone_on.filter_frames, whole.filter_frames);  // what was in memory ran again
  }
}

}  // namespace
}  // namespace stemvo::search
