// SPDX-License-Identifier: MIT
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "odometry/road/estimators.hpp"
#include "odometry/road/region.hpp"
#include "support/road_scene.hpp"

namespace stemvo {
namespace {

using testing::in_units;
using testing::near;
using testing::render_pair;
using testing::RoadPair;
using testing::RoadScene;

struct PlaneCase {
  double height_m;
  double slope_rad;
  double roll_rad;
  double step_m;
  double yaw_rad;
};
class RoadDensePlane : public ::testing::TestWithParam<PlaneCase> {};

TEST_P(RoadDensePlane, FindsThePlantedPlane) {
  const PlaneCase c = GetParam();
  RoadScene scene;
  scene.height_m = c.height_m;
  scene.slope_rad = c.slope_rad;
  scene.roll_rad = c.roll_rad;
  scene.noise_gray = 1.0;
  const RoadPair pair = render_pair(scene, c.step_m, c.yaw_rad);
  RoadOptions options;
  options.camera_height_m = c.height_m;
  RoadPrior prior = near(2.0 * 1.02);  // 2 % off
  const RoadMeasurement road =
      measure_dense({pair.prev, pair.cur, in_units(pair.cur_from_prev, 2.0), prior, options});
  ASSERT_TRUE(road.is_valid) << road.reason;
  EXPECT_NEAR(road.log_scale, std::log(2.0), 0.015);
  EXPECT_LT(std::abs(road.log_scale - std::log(2.0)), 4.0 * road.sigma);
  EXPECT_LT(road.sigma, 0.03);
  EXPECT_NEAR(road.slope_rad, c.slope_rad, 0.003);
  EXPECT_NEAR(road.roll_rad, c.roll_rad, 0.004);
}

INSTANTIATE_TEST_SUITE_P(Planes,
                         RoadDensePlane,
                         ::testing::Values(PlaneCase{1.65, 0.0, 0.0, 0.8, 0.0},
                                           PlaneCase{1.65, 0.015, 0.0, 0.8, 0.0},
                                           PlaneCase{1.65, -0.02, 0.02, 0.8, 0.0},
                                           PlaneCase{1.65, 0.0, -0.03, 1.4, 0.0},
                                           PlaneCase{1.2, 0.01, 0.01, 0.5, 0.0},
                                           PlaneCase{1.65, 0.0, 0.0, 0.8, 0.04},
                                           PlaneCase{1.65, 0.0, 0.0, 0.8, -0.04}));

TEST(RoadDense, FindsAnUnknownScale) {
  const RoadScene scene;
  const RoadPair pair = render_pair(scene, 1.1);
  RoadPrior prior;
  prior.log_scale = std::log(0.8);
  prior.log_scale_sigma = 1.0;
  const RoadMeasurement road =
      measure_dense({pair.prev, pair.cur, in_units(pair.cur_from_prev, 1.1), prior, RoadOptions{}});
  ASSERT_TRUE(road.is_valid) << road.reason;
  EXPECT_NEAR(road.log_scale, std::log(1.1), 0.01);
}

TEST(RoadDense, SmallErrorsOfTheGivenRotationAreTakenUp) {
  const RoadScene scene;
  const RoadPair pair = render_pair(scene, 0.8);
  Rigid3 motion = pair.cur_from_prev;
  motion.rotation = so3_exp({2e-4, -2e-4, 1e-4}) * motion.rotation;
  RoadOptions options;
  options.rotation_sigma_rad = 3e-4;
  const RoadMeasurement free = measure_dense({pair.prev, pair.cur, motion, near(1.0), options});
  options.rotation_sigma_rad = 1e-7;
  const RoadMeasurement fixed = measure_dense({pair.prev, pair.cur, motion, near(1.0), options});
  ASSERT_TRUE(free.is_valid) << free.reason;
  ASSERT_TRUE(fixed.is_valid) << fixed.reason;
  EXPECT_NEAR(free.log_scale, 0.0, 0.012);
  EXPECT_GT(free.sigma, fixed.sigma);
}

TEST(RoadDense, ACarAheadThatCoversHalfOfTheStripIsLeftOut) {
  RoadScene scene;
  scene.is_covered = [](int u, int v) { return u > 320 && u < 480 && v > 110 && v < 230; };
  const RoadPair pair = render_pair(scene, 0.8);
  const RoadMeasurement road =
      measure_dense({pair.prev, pair.cur, pair.cur_from_prev, near(1.0), RoadOptions{}});
  ASSERT_TRUE(road.is_valid) << road.reason;
  EXPECT_NEAR(road.log_scale, 0.0, 0.015);
}

TEST(RoadDense, AKerbAtTheSideCostsLittle) {
  RoadScene scene;
  scene.bump = [](double x, double /*z*/) { return x > 1.1 ? 0.12 : 0.0; };
  const RoadPair pair = render_pair(scene, 0.8);
  const RoadMeasurement road =
      measure_dense({pair.prev, pair.cur, pair.cur_from_prev, near(1.0), RoadOptions{}});
  ASSERT_TRUE(road.is_valid) << road.reason;
  EXPECT_NEAR(road.log_scale, 0.0, 0.025);
}

TEST(RoadDense, SaysWhyThereIsNoMeasurement) {
  const RoadOptions options;
  RoadScene blank;
  blank.has_road = false;
  const RoadPair plain = render_pair(blank, 0.8);
  const RoadMeasurement no_texture =
      measure_dense({plain.prev, plain.cur, plain.cur_from_prev, near(1.0), options});
  EXPECT_FALSE(no_texture.is_valid);
  EXPECT_EQ(no_texture.reason, "nothing moves like a road");

  blank.noise_gray = 20.0;  // two images that have nothing to do with each other
  const RoadPair noise = render_pair(blank, 0.8);
  EXPECT_FALSE(
      measure_dense({noise.prev, noise.cur, noise.cur_from_prev, near(1.0), options}).is_valid);

  const RoadPair road = render_pair(RoadScene{}, 0.8);
  EXPECT_EQ(measure_dense({road.prev, road.cur, Rigid3{}, near(1.0), options}).reason, "no motion");

  // An image that ends at the horizon.
  const cv::Mat sky(130, 660, CV_8U, cv::Scalar(200));
  const RoadImage above = make_road_image({sky, {}}, RoadScene{}.camera);
  EXPECT_EQ(measure_dense({above, above, road.cur_from_prev, near(1.0), options}).reason,
            "the image ends above the road");
}

/// Too few for the coarse grid: that must not be the end.
TEST(RoadDense, ANarrowStripIsEnoughWhereTheScaleIsKnown) {
  RoadOptions options;
  options.half_width_m = 0.1;
  const RoadPair pair = render_pair(RoadScene{}, 0.8);
  const RoadPrior prior = near(1.02);
  const RoadImage::Level& level = pair.cur.full;
  const std::size_t num_pixels = RoadRegion(pair.cur_from_prev, prior, options)
                                     .samples(level.camera, level.first_row, 1, 1)
                                     .size();
  ASSERT_GT(num_pixels, 600U);
  ASSERT_LT(num_pixels, 2400U);
  const RoadMeasurement road =
      measure_dense({pair.prev, pair.cur, pair.cur_from_prev, prior, options});
  ASSERT_TRUE(road.is_valid) << road.reason;
  EXPECT_NEAR(road.log_scale, 0.0, 0.03);
}

TEST(RoadDense, AnImageOfHalfTheSizeGivesTheSameScale) {
  const RoadScene scene;
  RoadPair pair = render_pair(scene, 0.8);
  const auto halve = [&](const RoadImage& full) {
    ChannelImage image;
    cv::resize(full.pixels, image.pixels, {}, 0.5, 0.5, cv::INTER_AREA);
    image.map = {{2.0, 2.0}, {0.5, 0.5}};
    return make_road_image(image, scene.camera);
  };
  const RoadMeasurement road = measure_dense(
      {halve(pair.prev), halve(pair.cur), pair.cur_from_prev, near(1.0), RoadOptions{}});
  ASSERT_TRUE(road.is_valid) << road.reason;
  EXPECT_NEAR(road.log_scale, 0.0, 0.02);
}

}  // namespace
}  // namespace stemvo
