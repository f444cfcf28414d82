// SPDX-License-Identifier: MIT
#include <cmath>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

#include "robustness/contenders.hpp"
#include "robustness/outcome.hpp"
#include "robustness/robustness.hpp"

namespace stemvo::robustness {
namespace {

using enum FrameState;

/// Frames along z, a metre each.
Trajectory straight(std::size_t num) {
  Trajectory poses(num);
  for (std::size_t i = 0; i < num; ++i) {
    poses[i].translation.z() = static_cast<double>(i);
  }
  return poses;
}

Outcome outcome_of(const std::vector<FrameState>& states,
                   const std::vector<bool>& is_disturbed,
                   const Trajectory& estimate) {
  Outcome outcome;
  add_states(states, estimate, straight(states.size()), is_disturbed, outcome);
  return outcome;
}

Outcome outcome_of(const std::vector<FrameState>& states, const std::vector<bool>& is_disturbed) {
  return outcome_of(states, is_disturbed, straight(states.size()));
}

TEST(Recovery, IsTheLongestWayBackToLandmarks) {
  const Outcome outcome = outcome_of(
      {kFirst, kTracking, kLost, kLost, kInitializing, kInitializing, kTracking, kLost, kTracking},
      {false, false, true, false, false, false, false, true, false});
  EXPECT_EQ(outcome.recovery_frames, 3U);  // initializing is not yet found
  EXPECT_TRUE(outcome.is_recovered);
  EXPECT_NEAR(outcome.tracked, 6.0 / 9.0, 1e-12);
}

TEST(Recovery, OfAFrameThatIsFollowedTakesNone) {
  EXPECT_EQ(outcome_of({kFirst, kTracking, kStationary}, {false, true, false}).recovery_frames, 0U);
}

TEST(Recovery, IsUnknownWhereNoDisturbanceEnds) {
  EXPECT_FALSE(outcome_of({kFirst, kLost, kLost}, {false, true, true}).recovery_frames);
  // Lost before anything happened.
  EXPECT_FALSE(outcome_of({kFirst, kLost, kLost}, {false, false, false}).recovery_frames);
}

TEST(Recovery, SaysWhereTheCameraIsNeverFoundAgain) {
  const Outcome to_the_end = outcome_of({kFirst, kLost, kLost, kLost}, {false, true, false, false});
  EXPECT_EQ(to_the_end.recovery_frames, 2U);
  EXPECT_FALSE(to_the_end.is_recovered);
  const Outcome to_the_next =
      outcome_of({kFirst, kLost, kLost, kTracking, kTracking}, {false, true, false, true, false});
  EXPECT_EQ(to_the_next.recovery_frames, 1U);
  EXPECT_FALSE(to_the_next.is_recovered);
}

TEST(Jumps, CountWhereTheStateSaysFound) {
  const std::vector<FrameState> states = {kFirst, kTracking, kTracking, kLost, kTracking};
  const std::vector<bool> calm(states.size());
  const auto turned_at = [&](std::size_t frame, double angle_rad) {
    Trajectory poses = straight(states.size());
    for (std::size_t i = frame; i < poses.size(); ++i) {
      poses[i].rotation = Eigen::AngleAxisd(angle_rad, Eigen::Vector3d::UnitY());
    }
    return outcome_of(states, calm, poses).jumps;
  };
  EXPECT_EQ(turned_at(2, 0.02), 1U);
  EXPECT_EQ(turned_at(2, 0.015), 0U);  // below a degree
  EXPECT_EQ(turned_at(3, 0.02), 0U);   // its state says lost
  EXPECT_EQ(turned_at(4, 0.02), 0U);   // found again: where it is, not how it came there
}

TEST(Segments, BlockIsAsLongAsTheLongestOfThem) {
  Trajectory truth = straight(80);
  for (std::size_t i = 40; i < 80; ++i) {  // slowly from here on
    truth[i].translation.z() = 40.0 + 0.25 * static_cast<double>(i - 40);
  }
  Outcome outcome;
  add_errors(truth, truth, {}, outcome);
  ASSERT_FALSE(outcome.dense.r_deg_per_100m.empty());
  EXPECT_GE(outcome.dense.block, 25U);  // an eighth of 50 m at a quarter of a metre a frame
  EXPECT_LE(outcome.dense.block, 27U);
}

TEST(Contenders, KeepWhatTheJudgedModelNeeds) {
  Config judged;
  judged.stem.model = "net";
  judged.stem.sampling_px = 4;
  const auto made = make_contenders(judged, {"net:7", "other:3", "gray", "net:7", "blue"}, true);
  ASSERT_TRUE(made);
  ASSERT_EQ(made->size(), 5U);  // one given twice counts once
  EXPECT_EQ((*made)[1].config.stem.sampling_px, 4);
  EXPECT_EQ((*made)[1].config.stem.filter, 7);
  EXPECT_EQ((*made)[2].config.stem.model, "other");
  EXPECT_EQ((*made)[4].config.stem.model, "input_layer");
  EXPECT_EQ((*made)[4].config.stem.filter, 2);
  EXPECT_EQ(make_contenders(judged, {}, false)->size(), 1 + all_controls().size() - 3);
}

/// Ratios of rotations; translations are twice as large.
Row row_of(const std::string& group, const ErrorRatio& rotation) {
  Row row;
  row.group = group;
  row.verdicts = {
      {rotation, {2 * rotation.ratio, 2 * rotation.low, 2 * rotation.high}},
  };
  return row;
}

TEST(Summaries, AreGeometricMeansOfGroupsAndOfAll) {
  const double infinity = std::numeric_limits<double>::infinity();
  const std::vector<Row> rows = {
      row_of("light", {0.5, 0.4, 0.6}), row_of("noise", {4.0, 0, infinity}),
      row_of("light", {2.0, 1.5, 2.5}), row_of("light", {1.0, 0.8, 1.2})};
  const std::vector<Summary> found = summaries(rows, 0);
  ASSERT_EQ(found.size(), 3U);
  EXPECT_EQ(found[0].group, "light");
  EXPECT_EQ(found[0].num_rows, 3U);
  EXPECT_NEAR(*found[0].rotation_ratio, 1.0, 1e-12);
  EXPECT_NEAR(*found[0].translation_ratio, 2.0, 1e-12);
  EXPECT_EQ(found[0].num_for_judged, 1U);
  EXPECT_EQ(found[0].num_for_control, 1U);
  EXPECT_EQ(found[1].num_for_control, 0U);  // an interval of everything decides nothing
  EXPECT_EQ(found[2].group, "all");
  EXPECT_FALSE(found[1].rotation_ratio);  // and has no ratio to believe in
  EXPECT_NEAR(*found[2].rotation_ratio, 1.0, 1e-12);
}

TEST(Summaries, TellDrivesApart) {
  const auto outcome = [](std::optional<double> r_rel) {
    Outcome one;
    one.r_rel_deg_per_100m = r_rel;
    return one;
  };
  Row first;
  first.outcomes = {{outcome(1.0), outcome(2.0)}, {outcome(2.0), outcome(1.0)}};
  Row second;
  second.outcomes = {{outcome(1.0), outcome(std::nullopt)}, {outcome(8.0), outcome(1.0)}};
  EXPECT_NEAR(*ratio_on_drive({first, second}, 0, 0), 0.25, 1e-12);
  EXPECT_NEAR(*ratio_on_drive({first, second}, 0, 1), 2.0, 1e-12)
      << "the second row has no segment";
  EXPECT_FALSE(ratio_on_drive({second}, 0, 1));
}

}  // namespace
}  // namespace stemvo::robustness
