// SPDX-License-Identifier: MIT
#include "odometry/road/model.hpp"
#include "odometry/road/region.hpp"
#include "support/road_scene.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

/// An estimator, and how far it may be off from planes and scenes that are planted.
struct Estimator {
  const char* name;
  RoadMeasurement (*measure)(const RoadStep&);
  double log_scale;
  double sigma;
  double slope_rad;
  double roll_rad;
  double behind_a_car;  ///< log scale again
  const char* blank;    ///< why there is none on a plain road
};
struct PlaneCase {
  double height_m;
  double slope_rad;
  double roll_rad;
  double step_m;
  double yaw_rad;
};

class RoadEstimator : public ::testing::TestWithParam<Estimator> {};

TEST_P(RoadEstimator, FindsThePlantedPlane) {
  const Estimator& bounds = GetParam();
  for (const PlaneCase& c : {PlaneCase{1.65, 0.0, 0.0, 0.8, 0.0},
                             {1.65, 0.015, 0.0, 0.8, 0.0},
                             {1.65, -0.02, 0.02, 0.8, 0.0},
                             {1.65, 0.0, -0.03, 1.4, 0.0},
                             {1.2, 0.01, 0.01, 0.5, 0.0},
                             {1.65, 0.0, 0.0, 0.8, 0.04},
                             {1.65, 0.0, 0.0, 0.8, -0.04}}) {
    SCOPED_TRACE(fmt::format("{} m, {}, {}, {}", c.height_m, c.slope_rad, c.roll_rad, c.yaw_rad));
    const RoadScene scene{.height_m = c.height_m,
                          .slope_rad = c.slope_rad,
                          .roll_rad = c.roll_rad,
                          .noise_gray = 1.0};
    const RoadPair pair = render_pair(scene, c.step_m, c.yaw_rad);
    const RoadOptions options{.camera_height_m = c.height_m};
    const RoadMeasurement road = bounds.measure(
        {pair.prev, pair.cur, in_units(pair.cur_from_prev, 2.0), near(2.0 * 1.02), options});
    ASSERT_TRUE(road.is_valid) << road.reason;
    EXPECT_NEAR(road.log_scale, std::log(2.0), bounds.log_scale);
    EXPECT_LT(std::abs(road.log_scale - std::log(2.0)), 4.0 * road.sigma);
    EXPECT_LT(road.sigma, bounds.sigma);
    EXPECT_NEAR(road.slope_rad, c.slope_rad, bounds.slope_rad);
    EXPECT_NEAR(road.roll_rad, c.roll_rad, bounds.roll_rad);
  }
}

TEST_P(RoadEstimator, ACarAheadThatCoversHalfOfTheStripIsLeftOut) {
  const RoadScene scene{
      .is_covered = [](int u, int v) { return u > 320 && u < 480 && v > 110 && v < 230; }};
  const RoadPair pair = render_pair(scene, 0.8);
  const RoadMeasurement road =
      GetParam().measure({pair.prev, pair.cur, pair.cur_from_prev, near(1.0), RoadOptions{}});
  ASSERT_TRUE(road.is_valid) << road.reason;
  EXPECT_NEAR(road.log_scale, 0.0, GetParam().behind_a_car);
}

TEST_P(RoadEstimator, SaysWhyThereIsNoMeasurement) {
  const auto measured = [](const RoadPair& pair, const Rigid3& motion) {
    return GetParam().measure({pair.prev, pair.cur, motion, near(1.0), RoadOptions{}});
  };
  RoadScene blank{.has_road = false};
  const RoadPair plain = render_pair(blank, 0.8);
  EXPECT_FALSE(measured(plain, plain.cur_from_prev).is_valid);
  EXPECT_EQ(measured(plain, plain.cur_from_prev).reason, GetParam().blank);
  blank.noise_gray = 20.0;  // two images that have nothing to do with each other
  const RoadPair noise = render_pair(blank, 0.8);
  EXPECT_FALSE(measured(noise, noise.cur_from_prev).is_valid);
}

INSTANTIATE_TEST_SUITE_P(Both,
                         RoadEstimator,
                         ::testing::Values(Estimator{"dense", measure_dense, 0.015, 0.03, 0.003,
                                                     0.004, 0.015, "nothing moves like a road"},
                                           Estimator{"points", measure_points, 0.025, 0.04, 0.006,
                                                     0.02, 0.025, "no corners on the road"}),
                         [](const auto& estimator) { return estimator.param.name; });

TEST(RoadDense, FindsAnUnknownScale) {
  const RoadScene scene;
  const RoadPair pair = render_pair(scene, 1.1);
  RoadPrior prior{.log_scale = std::log(0.8), .log_scale_sigma = 1.0};
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
  RoadOptions options{.rotation_sigma_rad = 3e-4};
  const RoadMeasurement free = measure_dense({pair.prev, pair.cur, motion, near(1.0), options});
  options.rotation_sigma_rad = 1e-7;
  const RoadMeasurement fixed = measure_dense({pair.prev, pair.cur, motion, near(1.0), options});
  ASSERT_TRUE(free.is_valid) << free.reason;
  ASSERT_TRUE(fixed.is_valid) << fixed.reason;
  EXPECT_NEAR(free.log_scale, 0.0, 0.012);
  EXPECT_GT(free.sigma, fixed.sigma);
}

TEST(RoadDense, AKerbAtTheSideCostsLittle) {
  RoadScene scene{.bump = [](double x, double /*z*/) { return x > 1.1 ? 0.12 : 0.0; }};
  const RoadPair pair = render_pair(scene, 0.8);
  const RoadMeasurement road =
      measure_dense({pair.prev, pair.cur, pair.cur_from_prev, near(1.0), RoadOptions{}});
  ASSERT_TRUE(road.is_valid) << road.reason;
  EXPECT_NEAR(road.log_scale, 0.0, 0.025);
}

/// A low plane covers part of the strip, in either image or in both.
TEST(RoadDense, WhatAMaskHidesIsLeftOut) {
  const RoadPair road = render_pair(RoadScene{}, 0.8);
  const RoadPair low = render_pair(RoadScene{.height_m = 0.9}, 0.8);
  const auto off = [&](int width_px, bool covers_prev, bool covers_cur, bool is_masked) {
    cv::Mat mask(road.cur.pixels.size(), CV_8U, cv::Scalar(255));
    mask(cv::Rect(250, 170, width_px, mask.rows - 170)) = 0;
    const auto image = [&](const RoadImage& plain, const RoadImage& covering, bool covers) {
      cv::Mat pixels = plain.pixels.clone();
      covering.pixels.copyTo(pixels, covers ? mask == 0 : mask != mask);
      return make_road_image({pixels, {}}, RoadScene{}.camera,
                             covers && is_masked ? mask : cv::Mat());
    };
    const RoadMeasurement found = measure_dense({image(road.prev, low.prev, covers_prev),
                                                 image(road.cur, low.cur, covers_cur),
                                                 road.cur_from_prev,
                                                 {.log_scale = 0.3, .log_scale_sigma = 1.0},
                                                 {}});
    return found.is_valid ? std::abs(found.log_scale) : 1.0;
  };
  EXPECT_GT(off(150, true, true, false), 0.4);
  EXPECT_LT(off(150, true, true, true), 0.008);
  EXPECT_LT(off(150, false, true, true), 0.008);
  EXPECT_LT(off(100, true, false, true), 0.005);
}

TEST(RoadDense, AnImageThatEndsAtTheHorizonShowsNoRoad) {
  const Rigid3 motion(Eigen::Quaterniond::Identity(), {0.0, 0.0, -0.8});
  const cv::Mat sky(130, 660, CV_8U, cv::Scalar(200));
  const RoadImage above = make_road_image({sky, {}}, RoadScene{}.camera);
  EXPECT_EQ(measure_dense({above, above, motion, near(1.0), RoadOptions{}}).reason,
            "the image ends above the road");
}

TEST(RoadChannel, AnEdgeAcrossIsWhereItIsAndOneAlongIsNotSeen) {
  constexpr double kEdge_px = 300.25;
  for (const double focal_px : {700.0, 300.0}) {  // half of the size, all of it
    for (const int type : {CV_8UC1, CV_8UC3}) {
      const Camera camera{focal_px, focal_px, 60.0, 180.0, 121, 375};  // odd sides
      cv::Mat across(375, 121, type);
      cv::Mat along(375, 121, type);
      for (int v = 0; v < 375; ++v) {
        const double gray = 120.0 + 80.0 * std::tanh((v - kEdge_px) / 8.0);
        across.row(v).setTo(cv::Scalar::all(gray));
      }
      for (int u = 0; u < 121; ++u) {
        along.col(u).setTo(cv::Scalar::all(2.0 * u));
      }
      const Channel channel = road_channel(across, camera);
      EXPECT_EQ(channel.map.scale.x(), focal_px > 500.0 ? 2.0 : 1.0);
      cv::Mat column;
      cv::max(channel.values.col(10), 0.0, column);
      double sum = 0.0;
      for (int v = 0; v < column.rows; ++v) {
        sum += column.at<float>(v) * channel.map.to_input(Eigen::Vector2d(10, v)).y();
      }
      EXPECT_NEAR(sum / cv::sum(column)[0], kEdge_px, 0.05);
      EXPECT_LT(channel.map.offset_px.y(), 180.0) << "it begins above the horizon";
      EXPECT_LT(cv::norm(road_channel(along, camera).values, cv::NORM_INF), 1e-3);
    }
  }
}

/// Too few for the coarse grid: that must not be the end.
TEST(RoadDense, ANarrowStripIsEnoughWhereTheScaleIsKnown) {
  RoadOptions options{.half_width_m = 0.1};
  const RoadPair pair = render_pair(RoadScene{}, 0.8);
  const RoadPrior prior = near(1.02);
  const RoadImage::Level& level = pair.cur.full;
  const std::size_t num_pixels =
      RoadRegion(pair.cur_from_prev, prior, options).samples(level, 1, 1).size();
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
