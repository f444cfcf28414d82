// SPDX-License-Identifier: MIT
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "evaluation/paired_ratio.hpp"

namespace stemvo {
namespace {

constexpr std::size_t kBlock = 25;

/// Segments that overlap: running means over a block of `factor` times independent errors.
std::vector<double> drift(std::size_t count, double factor, std::mt19937_64& random) {
  std::lognormal_distribution<double> noise(0.0, 0.5);
  std::vector<double> steps(count + kBlock);
  for (double& step : steps) {
    step = factor * noise(random);
  }
  std::vector<double> errors(count, 0.0);
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t k = 0; k < kBlock; ++k) {
      errors[i] += steps[i + k] / static_cast<double>(kBlock);
    }
  }
  return errors;
}

PairedErrors pair_of(std::size_t count, double factor, std::mt19937_64& random) {
  return {drift(count, factor, random), drift(count, 1.0, random), kBlock};
}

TEST(PairedRatio, TheSameErrorsAreNotTold) {
  std::mt19937_64 random(1);
  const std::vector<double> errors = drift(300, 1.0, random);
  const ErrorRatio ratio = paired_ratio(std::vector{PairedErrors{errors, errors, kBlock}}, 1);
  EXPECT_DOUBLE_EQ(ratio.ratio, 1.0);
  EXPECT_FALSE(ratio.is_decided());
}

TEST(PairedRatio, FindsAFactorAndTurnsWithIt) {
  std::mt19937_64 random(2);
  const PairedErrors forth = pair_of(600, 0.7, random);
  const ErrorRatio ratio = paired_ratio(std::vector{forth}, 1);
  EXPECT_NEAR(ratio.ratio, 0.7, 0.07);
  EXPECT_TRUE(ratio.is_decided());
  EXPECT_LT(ratio.low, 0.7);
  EXPECT_GT(ratio.high, 0.7);
  const ErrorRatio back = paired_ratio(std::vector{PairedErrors{forth.b, forth.a, kBlock}}, 1);
  EXPECT_NEAR(back.ratio * ratio.ratio, 1.0, 1e-12);
  EXPECT_NEAR(back.low * ratio.high, 1.0, 0.01);
}

/// The purpose of the interval. Blocks of one segment would call many equals different.
TEST(PairedRatio, EqualMethodsAreCalledDifferentSeldom) {
  std::mt19937_64 random(3);
  constexpr int kTrials = 200;
  int num_blocks = 0;
  int num_single = 0;
  for (int i = 0; i < kTrials; ++i) {
    PairedErrors errors = pair_of(175, 1.0, random);  // 200 frames, segments of an eighth
    num_blocks += paired_ratio(std::vector{errors}, 1).is_decided() ? 1 : 0;
    errors.block = 1;
    num_single += paired_ratio(std::vector{errors}, 1).is_decided() ? 1 : 0;
  }
  EXPECT_LT(num_blocks, kTrials / 10);  // 5 % asked for
  EXPECT_GT(num_single, kTrials / 3);
}

/// A share; drives of so many blocks each.
double decided_by_chance(std::size_t num_drives, std::size_t num_blocks) {
  std::mt19937_64 random(4);
  constexpr int kTrials = 200;
  int num_decided = 0;
  for (int i = 0; i < kTrials; ++i) {
    std::vector<PairedErrors> drives;
    for (std::size_t k = 0; k < num_drives; ++k) {
      drives.push_back(pair_of(num_blocks * kBlock, 1.0, random));
    }
    num_decided += paired_ratio(drives, 1).is_decided() ? 1 : 0;
  }
  return static_cast<double>(num_decided) / kTrials;
}

TEST(PairedRatio, FewBlocksDecideSeldomOrNever) {
  EXPECT_LT(decided_by_chance(4, 7), 0.1);
  EXPECT_LT(decided_by_chance(2, 4), 0.1);
  EXPECT_LT(decided_by_chance(4, 2), 0.1);
  EXPECT_EQ(decided_by_chance(1, 4), 0.0);  // too few to say
}

TEST(PairedRatio, ADriveOfOneBlockDoesNotDecideForOthers) {
  std::mt19937_64 random(5);
  const PairedErrors equal = pair_of(300, 1.0, random);
  PairedErrors single = pair_of(kBlock, 4.0, random);
  EXPECT_EQ(paired_ratio(std::vector{equal, single}, 1).ratio,
            paired_ratio(std::vector{equal}, 1).ratio);
}

/// A disturbance that changes nothing is no further evidence.
TEST(PairedRatio, OneRoadSeveralTimesCountsOnce) {
  std::mt19937_64 random(6);
  PairedErrors drive = pair_of(300, 0.9, random);
  const ErrorRatio once = paired_ratio(std::vector{drive}, 1);
  drive.road = "00";
  const ErrorRatio thrice = paired_ratio(std::vector{drive, drive, drive}, 1);
  EXPECT_NEAR(thrice.ratio, once.ratio, 1e-12);
  EXPECT_NEAR(thrice.low, once.low, 1e-9);
  EXPECT_NEAR(thrice.high, once.high, 1e-9);
}

TEST(PairedRatio, DrivesCountAlikeAndThoseWithoutSegmentsNot) {
  const PairedErrors twice{std::vector<double>(100, 2.0), std::vector<double>(100, 1.0), 10};
  const PairedErrors half{std::vector<double>(10, 1.0), std::vector<double>(10, 2.0), 3};
  EXPECT_NEAR(paired_ratio(std::vector{twice, half}, 1).ratio, 1.0, 1e-12);
  EXPECT_NEAR(paired_ratio(std::vector{twice, PairedErrors{}}, 1).ratio, 2.0, 1e-12);
  EXPECT_FALSE(paired_ratio(std::vector{PairedErrors{}}, 1).is_decided());
  EXPECT_FALSE(paired_ratio({}, 1).is_decided());
}

}  // namespace
}  // namespace stemvo
