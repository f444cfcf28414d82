// SPDX-License-Identifier: MIT
#include "odometry/metric_scale.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

TEST(RoadLandmarks, AreThoseOfThreeKeyframesWithTheSigmaOfTheirParallax) {
  const Camera camera{700.0, 700.0, 600.0, 180.0, 1200, 360};
  Window window;
  window.landmarks = {{1, {0.0, 1.5, 14.0}}, {2, {0.0, 1.5, 14.0}}, {3, {0.0, 1.5, 2.0}}};
  for (int i = 0; i < 3; ++i) {
    Keyframe keyframe{i, Rigid3(Eigen::Quaterniond::Identity(), {0.0, 0.0, 1.0 * i}), {}};
    keyframe.points = {{.track_id = 1}};
    if (i > 0) {
      keyframe.points.push_back({.track_id = 2});  // seen by two only
    }
    keyframe.points.push_back({.track_id = 3});
    window.keyframes.push_back(keyframe);
  }
  const Rigid3 here(Eigen::Quaterniond::Identity(), {0.0, 0.0, 4.0});  // past the third
  const std::vector<RoadLandmark> found = road_landmarks(
      window, here, {{.track_id = 1}, {.track_id = 2}, {.track_id = 3}, {.track_id = 4}}, camera);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_TRUE(found[0].in_camera.isApprox(Eigen::Vector3d(0.0, 1.5, 10.0)));
  const double parallax_rad = std::atan2(1.5, 10.0) - std::atan2(1.5, 14.0);
  EXPECT_NEAR(found[0].sigma, 0.7 / 700.0 / std::sin(parallax_rad), 1e-6);
}

}  // namespace
}  // namespace stemvo
