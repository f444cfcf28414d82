// SPDX-License-Identifier: MIT
#include "odometry/metric_scale.hpp"
#include "odometry/scale_filter.hpp"
#include "odometry/way.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

constexpr double kPixelUnits = 0.01;

/// A drive whose map drifts, at 10 frames a second: what the scale is told, and what comes out.
struct PlantedDrive {
  std::function<double(double)> speed = [](double) { return 8.0; };  ///< m/s, by time
  double drift = 0.001;      ///< of log(metres per unit), per frame
  double interval_s = 0.1;   ///< between frames
  double place_noise = 0.0;  ///< of the camera's place, units of the guess
  Options options;
  WayInput ways{ScaleSource::kNone};

  double path_m = 0.0;   ///< true, from the first frame on that the scale was measured
  double found_m = 0.0;  ///< the same, as the scale has it
  double largest_step_error = 0.0;
  int num_far_off = 0;       ///< frames whose scale is wrong by over 3 sigma
  double units_per_m = 0.3;  ///< at first a guess
  FrameResult result;

  /// `give` adds what is measured before the frame of this time is.
  void run(int num_frames, const std::function<void(double)>& give) {
    MetricScale scale(options);
    std::mt19937_64 engine(5);
    std::normal_distribution<double> noise(0.0, place_noise);
    Eigen::Vector3d error = Eigen::Vector3d::Zero();
    scale.restart(nullptr, 0.0);
    for (int i = 1; i < num_frames; ++i) {
      const double now_s = interval_s * i;
      give(now_s);
      scale.add(ways.take(now_s));
      const double step_m = interval_s * speed(now_s - 0.5 * interval_s);
      units_per_m *= std::exp(-drift);
      Eigen::Vector3d next_error;
      std::ranges::generate(next_error, [&] { return noise(engine); });
      const Eigen::Vector3d step =
          Eigen::Vector3d(0.0, 0.0, -step_m * units_per_m) + next_error - error;
      error = next_error;
      const double factor =
          scale.measure(nullptr, Rigid3(Eigen::Quaterniond::Identity(), step), now_s, kPixelUnits);
      units_per_m *= factor;
      scale.report(result);
      if (result.scale_state == ScaleState::kMeasured || path_m > 0.0) {
        path_m += step_m;
        found_m += factor * step.norm();
        const double off = std::abs(std::log(units_per_m));
        largest_step_error = std::max(largest_step_error, off);
        num_far_off += off > 3.0 * result.scale_sigma.value() ? 1 : 0;
      }
    }
  }
  [[nodiscard]] double error() const { return found_m / path_m - 1.0; }
};

/// Speeds with this error at frames' times.
std::function<void(double)> speeds(PlantedDrive& drive, double noise) {
  auto engine = std::make_shared<std::mt19937_64>(7);
  return [&drive, noise, engine](double now_s) {
    const double true_speed = drive.speed(now_s);
    std::normal_distribution<double> error(0.0, noise);
    ASSERT_TRUE(drive.ways.add_speed(now_s, true_speed * (1.0 + error(*engine)),
                                     std::max(1e-3, noise * true_speed)));
  };
}

TEST(WayScale, NoiseOfSpeedsAveragesAndADriftingMapIsFollowed) {
  PlantedDrive drive;
  drive.run(800, speeds(drive, 0.02));
  EXPECT_EQ(drive.result.scale_state, ScaleState::kMeasured);
  EXPECT_NEAR(drive.error(), 0.0, 0.006);
  EXPECT_LT(drive.largest_step_error, 0.04) << "a walk of steps";
  EXPECT_LT(drive.result.scale_sigma.value(), 0.015);
}

// Ten times as far as a map mostly does: two real clips do in turns and at their start.
TEST(WayScale, WhereAMapDriftsFastBetweenWaysTheSigmaSaysIt) {
  PlantedDrive drive{.drift = 0.008};
  const auto give = speeds(drive, 0.02);
  drive.run(400, [&, next_s = 0.0](double now_s) mutable {
    if (now_s >= next_s) {
      give(now_s);
      next_s = now_s + 0.95;
    }
  });
  EXPECT_GT(drive.largest_step_error, 0.06);
  EXPECT_LE(drive.num_far_off, 45) << "of 390; without that, nine of ten";
}

// A speed of a second ago says nothing of the drift since then.
TEST(WayScale, LateSpeedsLeaveTheScaleLessSure) {
  PlantedDrive drive{.drift = 0.004};
  const auto give = speeds(drive, 0.02);
  drive.run(400, [&](double now_s) {
    if (now_s > 1.0) {
      give(now_s - 1.0);
    }
  });
  EXPECT_GT(drive.largest_step_error, 0.05);
  EXPECT_LE(drive.num_far_off, 4);
}

// Clocks differ: the scale swings as the speed does, and no map drifts so.
TEST(WayScale, SpeedsOfAnotherSecondLeaveTheScaleUnsure) {
  PlantedDrive drive{.speed = [](double s) { return 8.0 + 4.0 * std::sin(0.7 * s); }};
  drive.run(400, [&](double now_s) {
    ASSERT_TRUE(drive.ways.add_speed(now_s, drive.speed(now_s - 1.0), 0.1));
  });
  EXPECT_GT(drive.largest_step_error, 0.3);
  EXPECT_LE(drive.num_far_off, 60) << "of 390";
}

TEST(WayScale, ASpeedThatComesLateChangesTheUnitAndSaysSo) {
  PlantedDrive drive;
  const auto give = speeds(drive, 0.02);
  drive.run(60, [&](double now_s) {
    if (now_s > 3.0) {
      give(now_s);
    }
  });
  EXPECT_EQ(drive.result.scale_state, ScaleState::kMeasured);
  EXPECT_TRUE(drive.result.is_scale_new);
}

TEST(WayScale, AMapThatTakesAnothersUnitKeepsMetres) {
  MetricScale scale{Options()};
  WayInput input{ScaleSource::kNone};
  scale.restart(nullptr, 0.0);
  double units_per_m = 0.3;
  FrameResult result;
  for (int i = 1; i < 60; ++i) {
    if (i == 40) {
      scale.rescale(0.02);
      units_per_m *= 0.02;
    }
    ASSERT_TRUE(input.add_speed(0.1 * i, 8.0, 0.1));
    scale.add(input.take(0.1 * i));
    const Rigid3 step(Eigen::Quaterniond::Identity(), {0.0, 0.0, -0.8 * units_per_m});
    units_per_m *= scale.measure(nullptr, step, 0.1 * i, 0.01 * units_per_m);
    result = {};
    scale.report(result);
    EXPECT_EQ(result.is_scale_new, i == 40) << i;
    if (i >= 20) {
      EXPECT_NEAR(units_per_m, 1.0, 0.01) << i;
    }
  }
}

TEST(WayScale, ACameraThatStandsTellsNothing) {
  PlantedDrive drive;
  drive.speed = [](double now_s) {  // from 20 to 50 s
    return 5.0 * std::clamp(std::abs(now_s - 35.0) - 15.0, 0.0, 1.0);
  };
  drive.drift = 0.0;
  drive.place_noise = 0.05 * kPixelUnits;
  drive.run(700, [&](double now_s) {
    ASSERT_TRUE(drive.ways.add_speed(now_s, drive.speed(now_s) + 0.005, 0.02));
  });
  EXPECT_NEAR(drive.error(), 0.001, 0.002);
  EXPECT_LT(drive.largest_step_error, 0.05);
}

TEST(WayScale, AShortStepWaitsForOthers) {
  PlantedDrive drive;  // by 0.15 pixels a frame
  drive.speed = [](double) { return 0.05; };
  drive.drift = 0.0;
  drive.place_noise = 0.05 * kPixelUnits;
  drive.run(1500, speeds(drive, 0.02));
  EXPECT_LT(drive.largest_step_error, 0.06);
}

TEST(WayScale, SpeedsOfAnotherRateAndOtherTimesLateOnes) {
  for (const double interval_s : {0.01, 0.23, 1.0}) {
    PlantedDrive drive;
    drive.speed = [](double now_s) { return 6.0 + 2.0 * std::sin(0.3 * now_s); };
    drive.drift = 0.0;
    double next_s = -0.037;
    drive.run(600, [&](double now_s) {
      for (; next_s <= now_s - 0.3; next_s += interval_s) {  // three frames late
        ASSERT_TRUE(drive.ways.add_speed(next_s, drive.speed(next_s), 0.05));
      }
    });
    EXPECT_NEAR(drive.error(), 0.0, 0.01) << interval_s;
  }
}

TEST(WayScale, DistancesCountAsSpeedsDo) {
  PlantedDrive drive;
  drive.drift = 0.0;
  drive.run(400, [&](double now_s) {
    const int frame = static_cast<int>(std::lround(now_s / drive.interval_s));
    if (frame % 10 == 0) {
      ASSERT_TRUE(drive.ways.add_distance(now_s - 1.0, now_s, 8.0, 0.05));
    }
  });
  EXPECT_NEAR(drive.error(), 0.0, 0.005);
}

// The first frames already have the unit, though nothing was measured from one to the other yet.
TEST(WayScale, TheLastSpeedIsTheFirstGuess) {
  PlantedDrive drive;
  drive.run(4, [&](double now_s) {
    if (now_s < 0.15) {
      ASSERT_TRUE(drive.ways.add_speed(0.05, 8.0, 0.1));
    }
  });
  EXPECT_NEAR(drive.units_per_m, 1.0, 0.01);
  EXPECT_EQ(drive.result.scale_state, ScaleState::kNone);
}

// As a file of speeds has it: 2 %, at least 0.05 m/s.
TEST(WayInput, ASpeedWithoutASigmaHasTheUsualOne) {
  for (const auto& [speed, sigma] : {std::pair(-10.0, 0.2), std::pair(1.0, 0.05)}) {
    WayInput ways(ScaleSource::kNone);
    ASSERT_TRUE(ways.add_speed(0.0, speed));
    EXPECT_DOUBLE_EQ(ways.take(1.0).at(0).sigma_m, sigma);
  }
}

TEST(WayInput, RefusesWhatIsNoMeasurementAndSaysWhy) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  WayInput ways(ScaleSource::kNone);
  const auto speed = [&](double time_s, double metres_per_s, double sigma) {
    return message_of(ways.add_speed(time_s, metres_per_s, sigma));
  };
  EXPECT_THAT(speed(kNan, 1.0, 0.1), HasSubstr("speed: expected a finite number of seconds"));
  EXPECT_THAT(speed(0.0, kNan, 0.1), HasSubstr("expected -1000 to 1000 m/s, found nan"));
  EXPECT_THAT(speed(0.0, 1.0, 0.0), HasSubstr("expected a sigma above 0, found 0"));
  EXPECT_THAT(speed(0.0, 1.0, kNan), HasSubstr("expected a sigma above 0, found nan"));
  EXPECT_EQ(speed(1.0, -1.0, 0.1), "no error");
  EXPECT_THAT(speed(1.0, 1.0, 0.1), HasSubstr("after the last speed's, 1 s, found 1 s"));
  EXPECT_EQ(speed(1.5, 1.0, 0.1), "no error");
  ASSERT_EQ(ways.take(1.5).size(), 1U);
  EXPECT_EQ(speed(9.0, 1.0, 0.1), "no error");  // too far from the one before
  EXPECT_TRUE(ways.take(9.0).empty());
  const auto distance = [&](double from_s, double to_s, double metres, double sigma) {
    return message_of(ways.add_distance(from_s, to_s, metres, sigma));
  };
  EXPECT_THAT(distance(2.0, 1.0, 1.0, 0.1), HasSubstr("its beginning, 2 s, found 1 s"));
  EXPECT_THAT(distance(1.0, 2.0, -1.0, 0.1),
              HasSubstr("expected 0 m to 1000 m a second, found -1 m in 1 s"));
  EXPECT_THAT(distance(1.0, 2.0, 1.0, -0.1), HasSubstr("expected a sigma above 0, found -0.1"));
  EXPECT_EQ(distance(1.0, 2.0, 1.0, 0.1), "no error");
  EXPECT_THAT(distance(0.0, 2.0, 1.0, 0.1), HasSubstr("after the last distance's, 2 s, found 2 s"));
  WayInput constant(ScaleSource::kConstantSpeed);
  EXPECT_THAT(message_of(constant.add_speed(0.0, 1.0, 0.1)),
              HasSubstr("scale.source: expected none or camera_height"));
}

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
