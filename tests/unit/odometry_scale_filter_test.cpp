// SPDX-License-Identifier: MIT
#include "odometry/scale_filter.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

constexpr double kInterval_s = 0.1;
constexpr double kDriftSigma = 0.019;  // in a second
constexpr double kSigma = 0.03;
constexpr ScaleWitness kRoad = ScaleWitness::kRoad;

void measure(ScaleFilter& filter, int num, double log_scale, ScaleWitness witness = kRoad) {
  for (int i = 0; i < num; ++i) {
    filter.predict(kInterval_s);
    filter.update(log_scale, kSigma, witness);
  }
}

TEST(ScaleFilter, OneWildMeasurementMovesLittleAsManyAsBeforeWin) {
  for (const int num_before : {2, 8, 50}) {
    ScaleFilter filter(kDriftSigma);
    measure(filter, num_before, 0.0);
    filter.predict(kInterval_s);
    EXPECT_FALSE(filter.update(1.0, kSigma, kRoad));
    EXPECT_LT(std::abs(filter.log_scale()), num_before < 50 ? 0.1 : 0.02) << num_before;
    measure(filter, std::min(num_before + 10, 40), 1.0);
    EXPECT_NEAR(filter.log_scale(), 1.0, 0.02) << num_before;
  }
}

/// In a tight turn the strip ahead lies off the road: whole rendered 00, frames 3394 to 3408.
TEST(ScaleFilter, WhatManyFramesSaidIsNotOverturnedByATurn) {
  ScaleFilter filter(kDriftSigma);
  measure(filter, 200, 0.0);
  measure(filter, 20, -0.8);
  EXPECT_GT(filter.log_scale(), -0.15);
  measure(filter, 20, 0.0);
  EXPECT_NEAR(filter.log_scale(), 0.0, 0.02);
  measure(filter, 40, -0.8);
  EXPECT_NEAR(filter.log_scale(), -0.8, 0.05);
}

/// Seconds until a road that differs by `step` is followed half of the way.
double half_way_s(double step, double interval_s) {
  ScaleFilter filter(kDriftSigma);
  for (double time_s = 0.0; time_s < 20.0; time_s += interval_s) {
    filter.predict(interval_s);
    filter.update(0.0, kSigma, kRoad);
  }
  double time_s = 0.0;
  while (filter.log_scale() < 0.5 * step && time_s < 20.0) {
    filter.predict(interval_s);
    filter.update(step, kSigma, kRoad);
    time_s += interval_s;
  }
  return time_s;
}

TEST(ScaleFilter, AnyRateOfFramesTellsTheSameInTheSameTime) {
  for (const double step : {0.05, 1.0}) {  // believed at once; doubted first
    const double expected_s = half_way_s(step, 0.1);
    for (const double interval_s : {0.02, 0.05, 0.2}) {
      EXPECT_NEAR(half_way_s(step, interval_s), expected_s, 0.21) << step << ", " << interval_s;
    }
  }
}

TEST(ScaleFilter, WithoutJoiningEachMeasurementStandsAlone) {
  ScaleFilter filter(kDriftSigma, /*joins_frames=*/false);
  for (const double log_scale : {0.0, 1.0, -0.5}) {
    filter.predict(kInterval_s);
    EXPECT_TRUE(filter.update(log_scale, kSigma, kRoad));
    EXPECT_EQ(filter.log_scale(), log_scale);
  }
}

// Both in turn, each sure of itself: the road's plane may be a table, a way is one.
TEST(ScaleFilter, AWayThatContradictsTheRoadWinsAndKeepsWinning) {
  ScaleFilter filter(kDriftSigma);
  measure(filter, 50, 0.0);
  double last = 0.0;
  for (int i = 0; i < 100; ++i) {
    measure(filter, 1, 0.0);
    filter.update(1.0, 0.02, ScaleWitness::kWay);
    last = filter.log_scale();
    if (i >= 10) {
      EXPECT_NEAR(last, 1.0, 0.05) << i;
    }
  }
}

TEST(ScaleFilter, BothCountByTheirSigmas) {
  ScaleFilter filter(1e-6);
  for (int i = 0; i < 400; ++i) {
    filter.predict(kInterval_s);
    filter.update(0.0, 0.03, kRoad);
    filter.update(0.03, 0.015, ScaleWitness::kWay);
  }
  EXPECT_NEAR(filter.log_scale(), 0.03 * 4.0 / 5.0, 0.001);
}

}  // namespace
}  // namespace stemvo
