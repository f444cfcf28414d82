// SPDX-License-Identifier: MIT
#include "odometry/localization.hpp"
#include "support/synthetic_scene.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

constexpr double kBound_px = 4.0;

/// Landmarks that a camera sees `way` after it stood at `held`.
struct Moved {
  Camera camera = kitti_camera();
  Rigid3 held{so3_exp({0.02, 0.4, -0.01}), {3.0, -0.2, 8.0}};
  Rigid3 world_from_camera;
  SeenLandmarks seen;

  Moved(const Rigid3& way, double min_depth_m, double noise_px, int count = 200)
      : world_from_camera(held * way) {
    SceneRandom random(5);
    for (int i = 0; i < count; ++i) {
      const Eigen::Vector2d uv = random.pixel(camera);
      const double depth_m = random.uniform(min_depth_m, 2.0 * min_depth_m);
      seen.points.push_back(world_from_camera * (depth_m * camera.normalize(uv).homogeneous()));
      seen.uv.push_back(uv + random.noise(noise_px));
    }
  }
  [[nodiscard]] std::optional<double> parallax_px() const {
    return parallax_since_px(held.translation, world_from_camera, seen, camera, kBound_px);
  }
};

TEST(ParallaxSince, ATurnOnTheSpotHasNone) {
  // The pose found is a little off, as noise makes it.
  Moved turn({so3_exp({0.0, 5.0 * kDeg, 0.0}), Eigen::Vector3d::Zero()}, 10.0, 0.2);
  turn.world_from_camera =
      turn.world_from_camera * Rigid3(so3_exp({0.0, 1e-4, 0.0}), {0.003, 0.0, 0.003});
  ASSERT_TRUE(turn.parallax_px().has_value());
  EXPECT_LT(*turn.parallax_px(), 0.45);
}

TEST(ParallaxSince, AStepThatMovesTheImageHas) {
  const Rigid3 aside(so3_exp({0.0, 5.0 * kDeg, 0.0}), {0.05, 0.0, 0.0});
  // A shift to the side looks like a turn but for the differences in depth: 718 px * 0.05 m / Z.
  EXPECT_GT(Moved(aside, 10.0, 0.2).parallax_px().value(), 0.45);
  EXPECT_LT(Moved(aside, 100.0, 0.2).parallax_px().value(), 0.45);
  const Rigid3 ahead(Eigen::Quaterniond::Identity(), {0.0, 0.0, 0.5});
  EXPECT_GT(Moved(ahead, 10.0, 0.2).parallax_px().value(), 0.45);
}

TEST(ParallaxSince, FewLandmarksTellNothingAndFarOnesAreLeftOut) {
  const Rigid3 none;
  EXPECT_TRUE(Moved(none, 10.0, 0.2, 10).parallax_px().has_value());
  EXPECT_FALSE(Moved(none, 10.0, 0.2, 9).parallax_px().has_value());
  Moved wrong(none, 10.0, 0.2, 10);
  wrong.seen.uv.front().x() += 2.0 * kBound_px;
  EXPECT_FALSE(wrong.parallax_px().has_value());
}

}  // namespace
}  // namespace stemvo
