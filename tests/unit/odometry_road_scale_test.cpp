// SPDX-License-Identifier: MIT
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "odometry/road_filter.hpp"
#include "odometry/road_region.hpp"
#include "odometry/road_scale.hpp"
#include "support/road_scene.hpp"

namespace stemvo {
namespace {

using testing::RoadScene;

TEST(RoadFilter, AveragesAndKnowsHowWell) {
  RoadFilter filter{RoadOptions{}};
  std::mt19937_64 engine(3);
  std::normal_distribution<double> noise(0.0, 0.03);
  for (int i = 0; i < 200; ++i) {
    filter.predict();
    filter.update(0.7 + noise(engine), 0.01);
  }
  EXPECT_NEAR(filter.log_scale(), 0.7, 0.02);
  EXPECT_LT(filter.sigma(), 0.015);
}

TEST(RoadFilter, OneWildMeasurementMovesLittleSeveralWin) {
  RoadFilter filter{RoadOptions{}};
  for (int i = 0; i < 50; ++i) {
    filter.predict();
    filter.update(0.0, 0.01);
  }
  EXPECT_FALSE(filter.update(1.0, 0.01));
  EXPECT_LT(std::abs(filter.log_scale()), 0.02);
  for (int i = 0; i < 10; ++i) {
    filter.predict();
    filter.update(1.0, 0.01);
  }
  EXPECT_NEAR(filter.log_scale(), 1.0, 0.02);
}

TEST(RoadFilter, WithoutMeasurementsTheDoubtGrows) {
  RoadFilter filter{RoadOptions{}};
  filter.update(0.0, 0.01);
  double last = filter.sigma();
  for (int i = 0; i < 20; ++i) {
    filter.predict();
    EXPECT_GT(filter.sigma(), last);
    last = filter.sigma();
  }
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(filter.update(nan, 0.01));
  EXPECT_FALSE(filter.update(0.0, nan));
  EXPECT_FALSE(filter.update(0.0, 0.0));
  EXPECT_EQ(filter.log_scale(), 0.0);
}

TEST(RoadRegion, FollowsTheTurn) {
  const RoadOptions options;
  RoadPrior prior;
  // Right turn of radius 20 m, step 1 m.
  const Rigid3 cur_from_prev(so3_exp({0.0, -0.05, 0.0}), {0.025, 0.0, -1.0});
  const RoadRegion region(cur_from_prev, prior, options);
  const double height = options.camera_height_m;
  const auto at = [&](double x, double z) { return region.on_ground({x / z, height / z}); };
  const Eigen::Vector2d ahead = at(20.0 - std::sqrt(400.0 - 100.0), 10.0);
  EXPECT_NEAR(ahead.x(), 0.0, 0.02);
  EXPECT_NEAR(ahead.y(), 20.0 * std::asin(0.5), 0.02);
  EXPECT_GT(at(4.0, 10.0).x(), 1.0);
  EXPECT_FALSE(region.contains(at(0.0, 14.0)));
  EXPECT_FALSE(region.contains(region.on_ground({0.0, -0.1})));
}

/// Drives straight ahead over asphalt, 0.7 m a frame; the map's unit is 1 / kMetresPerUnit long.
class Drive {
 public:
  static constexpr double kStep_m = 0.7;
  static constexpr double kMetresPerUnit = 3.0;

  RoadScaleEstimate next(RoadScale& scale, bool has_road = true) {
    scene_.has_road = has_road;
    const Rigid3 camera_from_first(Eigen::Quaterniond::Identity(), {0.0, 0.0, -kStep_m * frame_});
    const cv::Mat picture =
        testing::render_road(scene_, camera_from_first, static_cast<std::uint64_t>(frame_));
    ++frame_;
    return scale.update({picture, {}}, step());
  }
  /// A frame that shows the last place again.
  RoadScaleEstimate stand(RoadScale& scale) {
    --frame_;
    const Rigid3 camera_from_first(Eigen::Quaterniond::Identity(), {0.0, 0.0, -kStep_m * frame_});
    ++frame_;
    return scale.update({testing::render_road(scene_, camera_from_first, 5), {}}, Rigid3{});
  }
  [[nodiscard]] const Camera& camera() const { return scene_.camera; }
  double metres_per_unit = kMetresPerUnit;

 private:
  [[nodiscard]] Rigid3 step() const {
    return {Eigen::Quaterniond::Identity(), {0.0, 0.0, -kStep_m / metres_per_unit}};
  }
  RoadScene scene_;
  int frame_ = 0;
};

TEST(RoadScale, FindsTheUnitOfTheMapAndHoldsIt) {
  Drive drive;
  RoadScale scale(RoadOptions{}, drive.camera());
  EXPECT_EQ(drive.next(scale).reason, "first frame");
  RoadScaleEstimate estimate;
  for (int i = 0; i < 12; ++i) {
    estimate = drive.next(scale);
  }
  EXPECT_TRUE(estimate.is_measured) << estimate.reason;
  EXPECT_NEAR(std::log(estimate.metres_per_unit / Drive::kMetresPerUnit), 0.0, 0.008);

  const RoadScaleEstimate standing = drive.stand(scale);
  EXPECT_EQ(standing.reason, "standing still");
  EXPECT_EQ(standing.metres_per_unit, estimate.metres_per_unit);
  EXPECT_EQ(standing.sigma, estimate.sigma);

  scale.rescale(2.0);
  drive.metres_per_unit /= 2.0;
  estimate = drive.next(scale);
  EXPECT_TRUE(estimate.is_measured) << estimate.reason;
  EXPECT_NEAR(std::log(estimate.metres_per_unit / (0.5 * Drive::kMetresPerUnit)), 0.0, 0.008);
}

TEST(RoadScale, WithoutARoadTheScaleStaysAndTheDoubtGrows) {
  Drive drive;
  RoadScale scale(RoadOptions{}, drive.camera());
  RoadScaleEstimate seen;
  for (int i = 0; i < 6; ++i) {
    seen = drive.next(scale);
  }
  RoadScaleEstimate lost;
  for (int i = 0; i < 6; ++i) {
    lost = drive.next(scale, false);
    EXPECT_FALSE(lost.is_measured);
    EXPECT_FALSE(lost.reason.empty());
  }
  EXPECT_EQ(lost.metres_per_unit, seen.metres_per_unit);
  EXPECT_GT(lost.sigma, seen.sigma);
  drive.next(scale);
  EXPECT_TRUE(drive.next(scale).is_measured);
}

TEST(RoadScale, ANonsenseMotionOrARestartForgetsTheUnit) {
  Drive drive;
  RoadScale scale(RoadOptions{}, drive.camera());
  for (int i = 0; i < 4; ++i) {
    drive.next(scale);
  }
  scale.restart();
  EXPECT_FALSE(drive.next(scale).is_initialized);
  EXPECT_TRUE(drive.next(scale).is_initialized);
  drive.metres_per_unit = std::numeric_limits<double>::quiet_NaN();
  const RoadScaleEstimate estimate = drive.next(scale);
  EXPECT_FALSE(estimate.is_initialized);
  EXPECT_TRUE(std::isfinite(estimate.metres_per_unit));
}

}  // namespace
}  // namespace stemvo
