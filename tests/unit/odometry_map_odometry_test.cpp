// SPDX-License-Identifier: MIT
#include <string_view>
#include <vector>

#include <gtest/gtest.h>

#include "odometry/map_odometry.hpp"
#include "odometry/road_picture.hpp"
#include "odometry/two_view_estimator.hpp"
#include "support/road_scene.hpp"
#include "support/synthetic_scene.hpp"

namespace stemvo {
namespace {

constexpr double kStep_m = 0.8;

/// Straight ahead along a road, past points on both sides whose tracks are exact.
struct RoadDrive {
  testing::RoadScene scene;
  std::vector<Eigen::Vector3d> points;

  RoadDrive() {
    testing::SceneRandom random(11);
    for (int i = 0; i < 800; ++i) {
      points.emplace_back(random.uniform(-12.0, 12.0), random.uniform(-4.0, 0.5),
                          random.uniform(6.0, 60.0));
    }
  }
  [[nodiscard]] Eigen::Vector3d in_camera(std::size_t i, int frame) const {
    return points[i] - Eigen::Vector3d(0.0, 0.0, kStep_m * frame);
  }
  [[nodiscard]] Matches matches(int frame) const {
    Matches result;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector3d prev = in_camera(i, frame - 1);
      const Eigen::Vector3d cur = in_camera(i, frame);
      if (cur.z() > 2.0 && testing::is_inside(scene.camera, scene.camera.project(prev)) &&
          testing::is_inside(scene.camera, scene.camera.project(cur))) {
        result.prev_uv.push_back(scene.camera.project(prev));
        result.cur_uv.push_back(scene.camera.project(cur));
        result.track_ids.push_back(static_cast<int>(i));
      }
    }
    return result;
  }
  [[nodiscard]] RoadPicture road_picture(int frame) const {
    const Rigid3 camera_from_start(Eigen::Quaterniond::Identity(), {0.0, 0.0, -kStep_m * frame});
    const cv::Mat pixels =
        testing::render_road(scene, camera_from_start, static_cast<std::uint64_t>(frame));
    return make_road_picture({pixels, {}}, scene.camera);
  }
};

Config metric_config() {
  Config config;
  config.odometry.mode = "map";
  config.scale.source = "camera_height";
  return config;
}

TEST(MapOdometry, WithoutARoadTheLastScaleIsKeptAndItsDoubtGrows) {
  RoadDrive drive;
  drive.scene.noise_gray = 1.0;
  const Config config = metric_config();
  const TwoViewEstimator estimator(config, drive.scene.camera);
  MapOdometry map(config, drive.scene.camera);
  map.restart(0, drive.road_picture(0));
  EXPECT_EQ(map.road_state(), RoadState::kNone);
  EXPECT_EQ(map.road_reason(), "first frame");
  const double unknown = map.scale_sigma().value();

  Rigid3 pose;
  double last_sigma = unknown;
  const int num_seen = 12;
  for (int i = 1; i < 20; ++i) {
    drive.scene.has_road = i < num_seen;
    const Matches matches = drive.matches(i);
    MeasuredMotion motion = estimator.measure(matches.prev_uv, matches.cur_uv, i == 1, 1);
    map.place(i, pose, matches, motion);
    map.refine(drive.road_picture(i), matches, motion);
    const Rigid3 step = motion.cur_from_prev.inverse();
    pose = pose * Rigid3(step.rotation, motion.step * step.translation);
    if (i < num_seen) {
      EXPECT_EQ(map.road_state(), RoadState::kMeasured) << i << ": " << map.road_reason();
      EXPECT_EQ(map.road_reason(), "");
    } else {
      EXPECT_EQ(map.road_state(), RoadState::kHeld) << i;
      EXPECT_NE(map.road_reason(), "");
      EXPECT_GT(map.scale_sigma().value(), last_sigma) << i;
      EXPECT_NEAR(motion.step, kStep_m, 0.03 * kStep_m) << i;
    }
    last_sigma = map.scale_sigma().value();
  }
  EXPECT_LT(last_sigma, 0.1 * unknown);
}

TEST(MapOdometry, ARoadThatIsNotAskedHasNoState) {
  RoadDrive drive;
  Config config = metric_config();
  config.scale.source = "constant";
  MapOdometry map(config, drive.scene.camera);
  map.restart(0, drive.road_picture(0));
  EXPECT_EQ(map.road_state(), RoadState::kDisabled);
  EXPECT_FALSE(map.scale_sigma().has_value());
}

}  // namespace
}  // namespace stemvo
