// SPDX-License-Identifier: MIT
#include <cmath>
#include <random>

#include <gmock/gmock.h>

#include "search/race.hpp"

namespace stemvo::search {
namespace {

using ::testing::ElementsAre;

DriveScore score(double t_rel, double r_rel) {
  DriveScore score;
  score.sequence = "00";
  score.frames = 100;
  score.detected = true;
  score.t_rel_percent = t_rel;
  score.r_rel_deg_per_100m = r_rel;
  return score;
}

FilterRecord record(int filter, std::size_t rung, std::vector<DriveScore> drives) {
  return {.rung = rung,
          .key = {"net", "stem", "patch", filter},
          .drives = std::move(drives),
          .held_out = std::nullopt,
          .filter_frames = 100,
          .held_out_filter_frames = 0};
}

SearchIdentity rungs(std::size_t count) {
  SearchIdentity identity;
  identity.rungs.resize(count);
  return identity;
}

std::vector<int> filters_of(const std::vector<FilterRow>& rows) {
  std::vector<int> filters;
  for (const FilterRow& row : rows) {
    filters.push_back(row.key.filter);
  }
  return filters;
}

TEST(Ranking, ByTRelThenRRelThenNotDetected) {
  DriveScore lost = score(0.1, 0.1);  // good numbers do not help
  lost.detected = false;
  const FilterRecords records = {record(0, 0, {score(2.0, 1.0)}), record(1, 0, {lost}),
                                 record(2, 0, {score(1.0, 3.0)}), record(3, 0, {score(1.0, 2.0)})};
  const auto rows = rank_filters(rungs(1), records);
  EXPECT_THAT(filters_of(rows), ElementsAre(3, 2, 0, 1));
  EXPECT_EQ(rows.back().status, FilterStatus::kNotDetected);
}

TEST(Ranking, IsOnTheMeanOfAllSequencesAndNeedsEach) {
  DriveScore lost = score(0.0, 0.0);
  lost.detected = false;
  const FilterRecords records = {record(0, 0, {score(1.0, 1.0), score(4.0, 1.0)}),
                                 record(1, 0, {score(2.0, 1.0), score(2.0, 1.0)}),
                                 record(2, 0, {score(0.5, 1.0), lost})};
  EXPECT_THAT(filters_of(rank_filters(rungs(1), records)), ElementsAre(1, 0, 2));
  EXPECT_DOUBLE_EQ(*mean_score({score(1.0, 1.0), score(4.0, 1.0)}).t_rel_percent, 2.5);
}

TEST(Ranking, TheMeanOfWhatOneSequenceLacksIsNone) {
  DriveScore good = score(1.0, 1.0);
  good.average_offset_m = 2.0;
  good.E_t_m = 0.5;
  const DriveScore mean = mean_score({good, DriveScore()});
  EXPECT_FALSE(mean.average_offset_m);
  EXPECT_FALSE(mean.E_t_m);
  EXPECT_FALSE(mean.early_error_percent);
  EXPECT_EQ(mean_score({good, good}).average_offset_m, 2.0);
}

TEST(Ranking, HeldOutAndStandingRankNothing) {
  FilterRecord good = record(1, 0, {score(1.0, 1.0)});
  FilterRecord other = record(0, 0, {score(2.0, 1.0)});
  other.held_out = score(0.0, 0.0);
  good.held_out = score(9.0, 9.0);
  good.drives[0].E_t_m = 5.0;  // E_t of `other` is that of a camera that stands
  EXPECT_THAT(filters_of(rank_filters(rungs(1), FilterRecords{other, good})), ElementsAre(1, 0));
}

/// Errors of 200 segments that scatter about a mean, ten of them alike.
DriveScore dense_score(double mean_percent, unsigned seed) {
  DriveScore result = score(mean_percent, 1.0);
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> factor(0.7, 1.3);
  for (int i = 0; i < 20; ++i) {
    result.dense_t_percent.insert(result.dense_t_percent.end(), 10, mean_percent * factor(random));
  }
  result.block = 10;
  return result;
}

TEST(Ranking, NamesThoseThatCannotBeToldFromTheBest) {
  const FilterRecords records = {record(0, 0, {dense_score(1.00, 1)}),
                                 record(1, 0, {dense_score(1.02, 2)}),
                                 record(2, 0, {dense_score(2.00, 3)})};
  const auto rows = rank_filters(rungs(1), records);
  EXPECT_TRUE(rows[0].is_equal);
  EXPECT_EQ(rows[0].over_best.ratio, 1.0);
  EXPECT_TRUE(rows[1].is_equal);
  EXPECT_GE(rows[1].over_best.ratio, 1.0);
  EXPECT_EQ(rows[2].key.filter, 2);
  EXPECT_FALSE(rows[2].is_equal);
  EXPECT_NEAR(rows[2].over_best.ratio, 2.0, 0.4);
  EXPECT_GT(rows[2].over_best.low, 1.0);
}

TEST(Ranking, NoDriveCountsForMoreBecauseItIsHard) {
  // Filter 0 has the lowest mean of t_rel, for the hard drive; filter 1 is far ahead on the others.
  const FilterRecords records = {
      record(0, 0, {dense_score(5.0, 1), dense_score(1.5, 2), dense_score(1.5, 3)}),
      record(1, 0, {dense_score(7.5, 4), dense_score(0.5, 5), dense_score(0.5, 6)}),
      record(2, 0, {dense_score(20.0, 7), dense_score(0.5, 8), dense_score(0.5, 9)})};
  const auto rows = rank_filters(rungs(1), records);
  EXPECT_EQ(rows[0].key.filter, 1);
  EXPECT_FALSE(rows[1].is_equal && rows[2].is_equal);
  for (const FilterRow& row : rows) {
    EXPECT_GE(row.over_best.ratio, 1.0);
  }
}

TEST(Ranking, DisturbedVersionsOfOneRoadTellNoMoreThanTheRoad) {
  const auto width_of = [](std::size_t num_drives, bool are_one_road) {
    SearchIdentity identity = rungs(1);
    FilterRecord good = record(0, 0, {});
    FilterRecord other = record(1, 0, {});
    for (std::size_t i = 0; i < num_drives; ++i) {
      const std::string suffix = "_dusk_" + std::to_string(i);
      SequenceIdentity& sequence = identity.sequences.emplace_back();
      sequence.name = "00" + suffix;
      sequence.disturbance = are_one_road ? suffix : "";
      good.drives.push_back(dense_score(1.0, 1));
      other.drives.push_back(dense_score(1.1, 2));
      good.drives.back().sequence = other.drives.back().sequence = sequence.name;
    }
    const ErrorRatio ratio = rank_filters(identity, {good, other}).back().over_best;
    return std::log(ratio.high / ratio.low);
  };
  const double one = width_of(1, true);
  EXPECT_NEAR(width_of(4, true), one, 0.05 * one);
  EXPECT_LT(width_of(4, false), 0.8 * one) << "four roads tell more than one";
}

TEST(Ranking, StoppedFiltersComeAfterThoseThatRanToTheEnd) {
  DriveScore early = score(0.5, 0.5);
  early.early_error_percent = 1.0;
  DriveScore worse = early;
  worse.early_error_percent = 2.0;
  const FilterRecords records = {record(0, 0, {early}),           record(1, 0, {early}),
                                 record(2, 0, {worse}),           record(3, 0, {early}),
                                 record(0, 1, {score(9.0, 9.0)}), record(1, 1, {worse}),
                                 record(0, 2, {score(9.0, 9.0)})};
  const auto rows = rank_filters(rungs(3), records);
  EXPECT_THAT(filters_of(rows), ElementsAre(0, 1, 3, 2));
  EXPECT_EQ(rows[0].status, FilterStatus::kRanked);
  EXPECT_EQ(rows[1].status, FilterStatus::kStopped);
}

/// Filter 0 ran to the end, 1 to 4 were stopped, 5 was not detected; the best is a baseline.
TEST(ContactSheet, ShowsTheBestMedianAndWorstOfAllFiltersWithATrajectoryBesideTheBaselines) {
  std::vector<FilterRow> rows;
  const auto add = [&rows](int filter, FilterStatus status, const std::string& model = "net") {
    FilterRow& row = rows.emplace_back();
    row.key = {model, "stem", "patch", filter};
    row.status = status;
  };
  add(0, FilterStatus::kRanked, "input_layer");
  add(0, FilterStatus::kRanked);
  for (const int filter : {1, 2, 3, 4}) {
    add(filter, FilterStatus::kStopped);
  }
  add(5, FilterStatus::kNotDetected);
  SearchIdentity identity;
  for (const std::string model : {"net", "input_layer"}) {
    LayerIdentity& layer = identity.layers.emplace_back();
    layer.model = model;
    layer.layer = "stem";
    layer.features = "patch";
    layer.last = 6;
    layer.baseline = model != "net";
  }
  const auto shown = choose_rows(identity, rows);
  ASSERT_EQ(shown.size(), 4U);
  EXPECT_EQ(shown[0].second, &rows[1]);
  EXPECT_EQ(shown[1].second->key.filter, 2);
  EXPECT_EQ(shown[2].second->key.filter, 4);
  EXPECT_EQ(shown[3], ShownFilters::value_type("baseline", &rows[0]));
  rows.clear();
  EXPECT_TRUE(choose_rows(identity, rows).empty());
}

TEST(Ranking, SurvivorsAreTheLeastWrongOfThoseDetected) {
  std::vector<FilterRecord> records;
  for (int i = 0; i < 4; ++i) {
    records.push_back(record(i, 0, {score(1.0, 1.0)}));
    records.back().drives[0].early_error_percent = 4.0 - i;
  }
  records[3].drives[0].detected = false;
  std::vector<const FilterRecord*> all;
  for (const FilterRecord& one : records) {
    all.push_back(&one);
  }
  const auto chosen = best_first(all);
  EXPECT_THAT(chosen, ElementsAre(2, 1, 0, 3));
}

TEST(Ranking, MoreInliersDecideBetweenErrorsThatAreNearlyEqual) {
  const auto best = [](double error, double inliers) {
    std::vector<FilterRecord> records = {record(0, 0, {score(1.0, 1.0)}),
                                         record(1, 0, {score(1.0, 1.0)})};
    records[0].drives[0].early_error_percent = 4.0;
    records[0].drives[0].inliers = 160.0;
    records[1].drives[0].early_error_percent = error;
    records[1].drives[0].inliers = inliers;
    const std::vector<const FilterRecord*> both = {&records[0], &records[1]};
    return best_first(both).front();
  };
  EXPECT_EQ(best(4.02, 160.0), 0U);
  EXPECT_EQ(best(4.02, 200.0), 1U);
  EXPECT_EQ(best(4.20, 200.0), 0U);  // a larger error is not made up for
}

TEST(Ranking, OfTheSameChannelOneSurvives) {
  std::vector<FilterRecord> records;
  for (int i = 0; i < 5; ++i) {
    records.push_back(record(i, 0, {score(1.0, 1.0)}));
    records.back().drives[0].early_error_percent = i < 3 ? 1.0 : i;
    records.back().drives[0].inliers = i == 2 ? 50.0 : 60.0;  // as wrong, and yet another one
  }
  std::vector<const FilterRecord*> all;
  for (const FilterRecord& one : records) {
    all.push_back(&one);
  }
  EXPECT_THAT(best_first(all), ElementsAre(0, 2, 3, 4, 1));
}

TEST(HalvingSchedule, KeepsTheBudgetAndEndsWithAllFrames) {
  for (const std::size_t count : {12U, 20U, 36U, 68U, 260U, 4096U}) {
    const Schedule schedule = halving_schedule(count);
    EXPECT_LE(cost_share(schedule), 0.25) << count;
    EXPECT_GE(cost_share(schedule), 0.20) << count;  // what is allowed is used
    EXPECT_EQ(schedule.front().filters, count);
    EXPECT_EQ(schedule.back().frame_share, 1.0);
    EXPECT_GE(schedule.back().filters, count < 16 ? 1U : 2U);
    for (std::size_t i = 1; i < schedule.size(); ++i) {
      EXPECT_LE(schedule[i].filters, schedule[i - 1].filters);
      EXPECT_GT(schedule[i].frame_share, schedule[i - 1].frame_share);
    }
  }
}

/// More filters go on to a rung than odometries are kept.
TEST(HalvingSchedule, HowManyFiltersFitIntoMemory) {
  EXPECT_LE(halving_schedule(892)[1].filters, kMaxKept);
  EXPECT_GT(halving_schedule(893)[1].filters, kMaxKept);
}

TEST(HalvingSchedule, FewFilters) {
  for (const std::size_t count : {8U, 9U, 10U, 11U, 12U, 13U, 14U, 15U}) {
    EXPECT_LE(cost_share(halving_schedule(count)), count < 12 ? 0.28 : 0.25) << count;
  }
  EXPECT_EQ(halving_schedule(0).back().filters, 0U);
  EXPECT_EQ(halving_schedule(1).back().filters, 1U);
  EXPECT_EQ(halving_schedule(3).front().filters, 3U);
  EXPECT_EQ(cost_share({{1.0, 7}}), 1.0);
}

TEST(HalvingSchedule, FramesOfARungLieInTheSequence) {
  EXPECT_EQ(frames_at({1.0 / 16.0, 4}, 100), 6U);
  EXPECT_EQ(frames_at({1.0 / 16.0, 4}, 3), 2U);
  EXPECT_EQ(frames_at({1.0, 4}, 100), 100U);
  EXPECT_EQ(frames_at({1.0, 4}, 1), 1U);
}

}  // namespace
}  // namespace stemvo::search
