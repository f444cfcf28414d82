// SPDX-License-Identifier: MIT
#include "odometry/road/belief.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

/// A frame on which a textured road is measured without error.
RoadEvidence good_frame() {
  RoadEvidence frame{.num_on = 8,
                     .num_above = 1,
                     .is_in_sight = true,
                     .measured_share = 1.0,
                     .innovation = 0.0,
                     .correlation = 0.8};
  return frame;
}

RoadBelief believed() {
  RoadBelief belief;
  for (int i = 0; i < 20; ++i) {
    belief.add(good_frame());
  }
  EXPECT_TRUE(belief.is_believed());
  return belief;
}

/// Frames until the belief changes; 100: it does not.
int frames_until(bool is_believed, RoadBelief belief, const RoadEvidence& frame) {
  int count = 0;
  while (belief.is_believed() != is_believed && count < 100) {
    belief.add(frame);
    ++count;
  }
  return count;
}

TEST(RoadBelief, AGoodRoadIsBelievedWithinAFewFramesNotAtOnce) {
  EXPECT_FALSE(RoadBelief().is_believed());
  const int count = frames_until(true, {}, good_frame());
  EXPECT_GT(count, 2);
  EXPECT_LT(count, 8);
  RoadEvidence plain = good_frame();  // asphalt without a corner
  plain.num_on = 0;
  plain.num_above = 0;
  EXPECT_LT(frames_until(true, {}, plain), 15);
}

TEST(RoadBelief, EachContradictionKeepsARoadFromBeingBelieved) {
  RoadEvidence below = good_frame();
  below.num_on = 5;
  below.num_below = 8;
  RoadEvidence above = good_frame();
  above.num_on = 10;
  above.num_above = 20;
  RoadEvidence jumps = good_frame();
  jumps.num_on = 2;
  jumps.innovation = 5.0;
  RoadEvidence tilts = good_frame();
  tilts.num_on = 2;
  tilts.num_above = 0;
  tilts.profile_chi2 = 30.0;
  RoadEvidence rolls = tilts;
  rolls.profile_chi2 = 0.0;
  rolls.roll_chi2 = 30.0;
  for (const RoadEvidence& frame : {below, above, jumps, tilts, rolls}) {
    EXPECT_EQ(frames_until(true, {}, frame), 100);
    EXPECT_LT(frames_until(false, believed(), frame), 40);
  }
}

TEST(RoadBelief, UnmeasuredFramesProveNothingAndTakeNothingAway) {
  RoadEvidence nothing;
  nothing.is_in_sight = true;
  EXPECT_EQ(frames_until(true, {}, nothing), 100);
  EXPECT_EQ(frames_until(false, believed(), nothing), 100);
}

TEST(RoadBelief, ARoadMeasuredOnEveryThirdFrameWithoutLandmarksIsNone) {
  RoadBelief belief;
  for (int i = 0; i < 300; ++i) {
    RoadEvidence frame;
    frame.is_in_sight = true;
    if (i % 3 == 0) {
      frame.measured_share = 0.5;
      frame.innovation = 1.0;
      frame.correlation = 0.6;
    }
    belief.add(frame);
    ASSERT_FALSE(belief.is_believed()) << i;
  }
}

TEST(RoadBelief, AnotherMapMustBeProvenOnceMoreButSooner) {
  RoadBelief belief = believed();
  belief.restart();
  EXPECT_FALSE(belief.is_believed());
  EXPECT_LT(frames_until(true, belief, good_frame()), frames_until(true, {}, good_frame()));
}

TEST(RoadBelief, WhatWasWrongForLongHasToBeRightForLong) {
  RoadEvidence wrong = good_frame();
  wrong.num_below = 40;
  RoadBelief belief;
  for (int i = 0; i < 1000; ++i) {
    belief.add(wrong);
  }
  const int count = frames_until(true, belief, good_frame());
  EXPECT_GT(count, 2 * frames_until(true, {}, good_frame()));
  EXPECT_LT(count, 30);
}

/// The sigma's mean factor in the second half of a drive; neighbouring errors correlate by
/// `correlation`.
double factor_of(double spread, double correlation) {
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0.0, spread * std::sqrt(1.0 - correlation * correlation));
  RoadBelief belief;
  double sum = 0.0;
  double error = 0.0;
  const int num_frames = 2000;
  for (int i = 0; i < num_frames; ++i) {
    RoadEvidence frame = good_frame();
    error = correlation * error + noise(random);
    frame.innovation = error;
    belief.add(frame);
    sum += 2 * i < num_frames ? 0.0 : belief.sigma_factor();
  }
  return 2.0 * sum / num_frames;
}

TEST(RoadBelief, TheSigmaFollowsTheSpreadOfTheMeasurements) {
  EXPECT_NEAR(factor_of(0.5, 0.6), 1.0, 0.25);
  EXPECT_NEAR(factor_of(1.0, 0.6), 2.0, 0.5);
  EXPECT_EQ(factor_of(0.01, 0.6), 0.5);
}

TEST(RoadBelief, TheSigmaIsSmallerWhereErrorsDoNotLast) {
  EXPECT_NEAR(factor_of(1.0, 0.0), 1.0, 0.2);
  EXPECT_GT(factor_of(1.0, 0.85), 2.2);
}

}  // namespace
}  // namespace stemvo
