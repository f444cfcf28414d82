// SPDX-License-Identifier: MIT
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "odometry/road/estimators.hpp"
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
class RoadPointsPlane : public ::testing::TestWithParam<PlaneCase> {};

TEST_P(RoadPointsPlane, FindsThePlantedPlane) {
  const PlaneCase c = GetParam();
  RoadScene scene;
  scene.height_m = c.height_m;
  scene.slope_rad = c.slope_rad;
  scene.roll_rad = c.roll_rad;
  scene.noise_gray = 1.0;
  const RoadPair pair = render_pair(scene, c.step_m, c.yaw_rad);
  RoadOptions options;
  options.camera_height_m = c.height_m;
  const RoadMeasurement road =
      measure_points({pair.prev, pair.cur, in_units(pair.cur_from_prev, 2.0), near(2.04), options});
  ASSERT_TRUE(road.is_valid) << road.reason;
  EXPECT_NEAR(road.log_scale, std::log(2.0), 0.025);
  EXPECT_LT(std::abs(road.log_scale - std::log(2.0)), 4.0 * road.sigma);
  EXPECT_LT(road.sigma, 0.04);
  EXPECT_NEAR(road.slope_rad, c.slope_rad, 0.006);
  EXPECT_NEAR(road.roll_rad, c.roll_rad, 0.02);
}

INSTANTIATE_TEST_SUITE_P(Planes,
                         RoadPointsPlane,
                         ::testing::Values(PlaneCase{1.65, 0.0, 0.0, 0.8, 0.0},
                                           PlaneCase{1.65, -0.02, 0.02, 0.8, 0.0},
                                           PlaneCase{1.65, 0.0, -0.03, 1.4, 0.0},
                                           PlaneCase{1.65, 0.0, 0.0, 0.8, 0.04}));

TEST(RoadPoints, ACarAheadIsLeftOut) {
  RoadScene scene;
  scene.is_covered = [](int u, int v) { return u > 320 && u < 480 && v > 110 && v < 230; };
  const RoadPair pair = render_pair(scene, 0.8);
  const RoadMeasurement road =
      measure_points({pair.prev, pair.cur, pair.cur_from_prev, near(1.0), RoadOptions{}});
  ASSERT_TRUE(road.is_valid) << road.reason;
  EXPECT_NEAR(road.log_scale, 0.0, 0.025);
}

TEST(RoadPoints, SaysWhyThereIsNoMeasurement) {
  const RoadOptions options;
  RoadScene blank;
  blank.has_road = false;
  const RoadPair plain = render_pair(blank, 0.8);
  EXPECT_EQ(measure_points({plain.prev, plain.cur, plain.cur_from_prev, near(1.0), options}).reason,
            "no corners on the road");

  blank.noise_gray = 20.0;  // two images that have nothing to do with each other
  const RoadPair noise = render_pair(blank, 0.8);
  EXPECT_FALSE(
      measure_points({noise.prev, noise.cur, noise.cur_from_prev, near(1.0), options}).is_valid);

  const RoadPair road = render_pair(RoadScene{}, 0.8);
  EXPECT_EQ(measure_points({road.prev, road.cur, Rigid3{}, near(1.0), options}).reason,
            "no motion");
}

}  // namespace
}  // namespace stemvo
