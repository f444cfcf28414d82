// SPDX-License-Identifier: MIT
#include "geometry/two_view_models.hpp"
#include "support/matchers.hpp"
#include "support/synthetic_scene.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

using Points = std::vector<Eigen::Vector2d>;

Eigen::Matrix3d shift(double x, double y) {
  Eigen::Matrix3d h = Eigen::Matrix3d::Identity();
  h(0, 2) = x;
  h(1, 2) = y;
  return h;
}

/// Pure sideways motion: epipolar lines are the rows of the image.
Eigen::Matrix3d row_fundamental() { return skew(Eigen::Vector3d(1.0, 0.0, 0.0)); }

TEST(ScoreHomography, HandWorked) {
  const Points prev = {{0.0, 0.0}, {100.0, 50.0}, {200.0, 80.0}, {10.0, 20.0}};
  // Shifted by (5, 0), then off by 0, 1, 2 and 3 px: the last is past sqrt(5.991) = 2.448.
  const Points cur = {{5.0, 0.0}, {105.0, 51.0}, {203.0, 80.0}, {15.0, 23.0}};
  const ModelScore score = score_homography(shift(5.0, 0.0), {prev, cur}, 1.0);
  EXPECT_NEAR(score.score, 2.0 * (3.0 * 5.991 - 0.0 - 1.0 - 4.0), 1e-9);
  EXPECT_EQ(score.num_inliers, 3);
  EXPECT_THAT(score.inlier_mask, ::testing::ElementsAre(1, 1, 1, 0));
  EXPECT_NEAR(score_homography(shift(5.0, 0.0), {prev, cur}, 2.0).score,
              2.0 * (4.0 * 5.991 - (0.0 + 1.0 + 4.0 + 9.0) / 4.0), 1e-9);
}

TEST(ScoreHomography, BothDirectionsAreCounted) {
  // Twice as large in cur: 3 px there are 1.5 px in prev, so one direction passes alone.
  const Eigen::Matrix3d zoom = Eigen::Vector3d(2.0, 2.0, 1.0).asDiagonal();
  const Points prev = {{10.0, 10.0}};
  const Points cur = {{23.0, 20.0}};
  const ModelScore score = score_homography(zoom, {prev, cur}, 1.0);
  EXPECT_NEAR(score.score, 5.991 - 2.25, 1e-9);
  EXPECT_EQ(score.num_inliers, 0);
}

TEST(ScoreFundamental, HandWorked) {
  const Points prev = {{0.0, 0.0}, {100.0, 50.0}, {200.0, 80.0}, {10.0, 20.0}};
  // Rows differ by 0, 1, 1.9 and 2 px: the last is past sqrt(3.841) = 1.96.
  const Points cur = {{50.0, 0.0}, {20.0, 51.0}, {203.0, 78.1}, {900.0, 22.0}};
  const ModelScore score = score_fundamental(row_fundamental(), {prev, cur}, 1.0);
  EXPECT_NEAR(score.score, 2.0 * (3.0 * 5.991 - 0.0 - 1.0 - 3.61), 1e-9);
  EXPECT_EQ(score.num_inliers, 3);
  EXPECT_THAT(score.inlier_mask, ::testing::ElementsAre(1, 1, 1, 0));
  EXPECT_NEAR(score_fundamental(row_fundamental(), {prev, cur}, 2.0).score,
              2.0 * (4.0 * 5.991 - (0.0 + 1.0 + 3.61 + 4.0) / 4.0), 1e-9);
}

TEST(DecomposeHomography, TrueMotionIsAmongTheEight) {
  const Eigen::Matrix3d k = kitti_camera().matrix();
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    SceneRandom random(seed);
    const Rigid3 motion = random.motion(0.5);
    Eigen::Vector3d normal = random.direction();
    normal *= normal.z() < 0.0 ? -1.0 : 1.0;
    const double distance = random.uniform(1.5, 10.0);
    const Eigen::Matrix3d euclidean =
        motion.rotation_matrix() + motion.translation * normal.transpose() / distance;
    const double scale = seed % 3 == 0 ? -3e5 : seed % 3 == 1 ? 1.0 : 1e-6;  // of one that has none
    const auto hypotheses =
        decompose_homography(scale * k * euclidean * k.inverse(), kitti_camera());
    ASSERT_EQ(hypotheses.size(), 8U);
    double best = std::numeric_limits<double>::infinity();
    for (const Rigid3& found : hypotheses) {
      best = std::min(best, std::max(rotation_error_rad(found, motion),
                                     direction_error_rad(found.translation, motion.translation)));
    }
    EXPECT_LE(best, 1e-9) << "seed " << seed;
  }
}

TEST(DecomposeHomography, RefusesWhatDoesNotDecompose) {
  const Camera camera = kitti_camera();
  const Eigen::Matrix3d k = camera.matrix();
  const Eigen::Matrix3d rotation = so3_exp(Eigen::Vector3d(0.01, -0.2, 0.03)).toRotationMatrix();
  EXPECT_TRUE(decompose_homography(k * rotation * k.inverse(), camera).empty());
  EXPECT_TRUE(decompose_homography(Eigen::Matrix3d::Zero(), camera).empty());
  EXPECT_TRUE(decompose_homography(Eigen::Matrix3d::Identity(), camera).empty());
  // Rank 1.
  EXPECT_TRUE(decompose_homography(Eigen::Matrix3d::Ones(), camera).empty());
}

TEST(EssentialMatrix, HoldsForMatchesAndConvertsToPixelsAndBack) {
  const Scene scene = make_scene({.num_points = 50, .seed = 4});
  const Eigen::Matrix3d e = essential_from_motion(scene.cur_from_prev);
  const Eigen::Matrix3d f = fundamental_from_essential(e, scene.camera);
  EXPECT_THAT(essential_from_fundamental(f, scene.camera), IsNear(e, 1e-12));
  ASSERT_EQ(scene.prev_uv.size(), 50U);
  for (std::size_t i = 0; i < scene.prev_uv.size(); ++i) {
    const Eigen::Vector3d line = f * scene.prev_uv[i].homogeneous();
    const double distance_px = line.dot(scene.cur_uv[i].homogeneous()) / line.head<2>().norm();
    EXPECT_NEAR(distance_px, 0.0, 1e-8);
  }
}

}  // namespace
}  // namespace stemvo
