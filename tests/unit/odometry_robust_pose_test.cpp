// SPDX-License-Identifier: MIT
#include "odometry/robust_models.hpp"
#include "support/synthetic_scene.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

struct PoseScene {
  Scene scene;
  Rigid3 camera_from_world;
  std::vector<Eigen::Vector3d> points_in_world;
};

/// A camera somewhere far from the origin that sees 150 points.
PoseScene pose_scene(double noise_px, double outlier_ratio, std::uint64_t seed) {
  SceneOptions options{
      .num_points = 150, .noise_px = noise_px, .outlier_ratio = outlier_ratio, .seed = seed};
  PoseScene result{make_scene(options), {}, {}};
  const Rigid3 world_from_prev(so3_exp({0.2, 2.5, -0.1}), {1200.0, -30.0, 2500.0});
  result.camera_from_world = result.scene.cur_from_prev * world_from_prev.inverse();
  for (const Eigen::Vector3d& point : result.scene.points_in_prev) {
    result.points_in_world.push_back(world_from_prev * point);
  }
  return result;
}

TEST(RobustPose, FindsThePoseWithoutAGuessAmongWrongMatchesAndTheSameBitsAgain) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const PoseScene s = pose_scene(0.3, 0.6, seed);
    const auto pose =
        estimate_absolute_pose(s.points_in_world, s.scene.cur_uv, s.scene.camera, 2.0, 1);
    ASSERT_TRUE(pose.has_value()) << seed;
    const Rigid3 error = *pose * s.camera_from_world.inverse();
    EXPECT_LT(error.angle_rad(), 5e-3) << seed;
    EXPECT_LT(error.translation.norm(), 0.05) << seed;
    const auto again =
        estimate_absolute_pose(s.points_in_world, s.scene.cur_uv, s.scene.camera, 2.0, 1);
    ASSERT_TRUE(again.has_value());
    EXPECT_EQ(again->translation, pose->translation);
    EXPECT_EQ(again->rotation.coeffs(), pose->rotation.coeffs());
  }
}

TEST(RobustPose, TooLittleOrDegenerateInputIsNoCrash) {
  const Scene scene = make_scene({});
  const std::vector<Eigen::Vector3d> few(5, Eigen::Vector3d(1.0, 2.0, 9.0));
  const std::vector<Eigen::Vector2d> few_uv(5, Eigen::Vector2d(100.0, 80.0));
  EXPECT_FALSE(estimate_absolute_pose(few, few_uv, scene.camera, 2.0, 1).has_value());
  const std::vector<Eigen::Vector3d> same(50, Eigen::Vector3d(1.0, 2.0, 9.0));
  const std::vector<Eigen::Vector2d> same_uv(50, Eigen::Vector2d(100.0, 80.0));
  const auto pose = estimate_absolute_pose(same, same_uv, scene.camera, 2.0, 1);
  EXPECT_TRUE(!pose.has_value() || pose->matrix().allFinite());
}

}  // namespace
}  // namespace stemvo
