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

TEST(ScoreHomography, SigmaScalesTheBound) {
  const Points prev = {{0.0, 0.0}};
  const Points cur = {{4.0, 0.0}};
  EXPECT_EQ(score_homography(Eigen::Matrix3d::Identity(), {prev, cur}, 1.0).score, 0.0);
  EXPECT_NEAR(score_homography(Eigen::Matrix3d::Identity(), {prev, cur}, 2.0).score,
              2.0 * (5.991 - 4.0), 1e-9);
}

TEST(ScoreHomography, ScaleOfTheMatrixDoesNotMatter) {
  const Scene scene = make_scene({.noise_px = 0.5, .planar = true, .seed = 3});
  const Eigen::Matrix3d h = true_homography(scene);
  const double expected = score_homography(h, {scene.prev_uv, scene.cur_uv}, 1.0).score;
  EXPECT_GT(expected, 0.0);
  for (const double scale : {-1.0, 1e-9, 1e7}) {
    const Eigen::Matrix3d scaled = scale * h;
    EXPECT_NEAR(score_homography(scaled, {scene.prev_uv, scene.cur_uv}, 1.0).score, expected,
                1e-6 * expected);
  }
}

TEST(ScoreHomography, SingularOrBrokenScoresZero) {
  const Scene scene = make_scene({.planar = true, .seed = 3});
  const Eigen::Matrix3d h = true_homography(scene);
  Eigen::Matrix3d rank_two = h;
  rank_two.col(2) = 2.0 * h.col(0) - 3.0 * h.col(1);
  Eigen::Matrix3d with_nan = h;
  with_nan(2, 2) = std::numeric_limits<double>::quiet_NaN();
  const Eigen::Matrix3d zero = Eigen::Matrix3d::Zero();
  const Eigen::Matrix3d ones = Eigen::Matrix3d::Ones();
  for (const Eigen::Matrix3d& m : {rank_two, with_nan, zero, ones}) {
    const ModelScore score = score_homography(m, {scene.prev_uv, scene.cur_uv}, 1.0);
    EXPECT_EQ(score.score, 0.0);
    EXPECT_EQ(score.num_inliers, 0);
    EXPECT_EQ(score.inlier_mask.size(), scene.prev_uv.size());
  }
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

TEST(ScoreFundamental, BrokenScoresZero) {
  const Scene scene = make_scene({.seed = 3});
  Eigen::Matrix3d with_nan = row_fundamental();
  with_nan(2, 2) = std::numeric_limits<double>::quiet_NaN();
  const Eigen::Matrix3d zero = Eigen::Matrix3d::Zero();
  for (const Eigen::Matrix3d& m : {with_nan, zero}) {
    const ModelScore score = score_fundamental(m, {scene.prev_uv, scene.cur_uv}, 1.0);
    EXPECT_EQ(score.score, 0.0);
    EXPECT_EQ(score.num_inliers, 0);
  }
}

TEST(Scores, BrokenPointsAreOutliersAndNoPointsScoreZero) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  const Points prev = {{1.0, 2.0}, {nan, 2.0}, {inf, 2.0}, {1.0, 2.0}};
  const Points cur = {{1.0, 2.0}, {1.0, 2.0}, {1.0, 2.0}, {1.0, nan}};
  const ModelScore h = score_homography(Eigen::Matrix3d::Identity(), {prev, cur}, 1.0);
  const ModelScore f = score_fundamental(row_fundamental(), {prev, cur}, 1.0);
  for (const ModelScore& score : {h, f}) {
    EXPECT_TRUE(std::isfinite(score.score));
    EXPECT_GE(score.inlier_mask[0], 1);
    EXPECT_EQ(score.num_inliers, 1);
  }
  EXPECT_EQ(score_homography(Eigen::Matrix3d::Identity(), {{}, {}}, 1.0).score, 0.0);
  EXPECT_EQ(score_fundamental(row_fundamental(), {{}, {}}, 1.0).score, 0.0);
}

TEST(Scores, MatchesThatDoNotPairAreOurMistake) {
  const Points one = {{1.0, 2.0}};
  EXPECT_THROW(static_cast<void>(score_homography(Eigen::Matrix3d::Identity(), {one, {}}, 1.0)),
               std::logic_error);
  EXPECT_THROW(static_cast<void>(score_fundamental(row_fundamental(), {{}, one}, 1.0)),
               std::logic_error);
}

TEST(HomographyRatio, IsTheShareOfTheHomography) {
  EXPECT_DOUBLE_EQ(homography_ratio(2.0, 3.0), 0.4);
  EXPECT_EQ(homography_ratio(0.0, 0.0), 0.0);
  EXPECT_EQ(homography_ratio(0.0, 5.0), 0.0);
  EXPECT_EQ(homography_ratio(5.0, 0.0), 1.0);
}

struct PlantedPlane {
  Rigid3 cur_from_prev;  ///< |translation| == 1
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
  double distance = 1.0;
};

PlantedPlane planted_plane(std::uint64_t seed) {
  SceneRandom random(seed);
  PlantedPlane plane;
  plane.cur_from_prev = random.motion(0.5);
  plane.normal = random.direction();
  plane.normal *= plane.normal.z() < 0.0 ? -1.0 : 1.0;
  plane.distance = random.uniform(1.5, 10.0);
  return plane;
}

Eigen::Matrix3d euclidean_homography(const PlantedPlane& plane) {
  return plane.cur_from_prev.rotation_matrix() +
         plane.cur_from_prev.translation * plane.normal.transpose() / plane.distance;
}

Eigen::Matrix3d pixel_homography(const PlantedPlane& plane) {
  const Eigen::Matrix3d k = kitti_camera().matrix();
  return k * euclidean_homography(plane) * k.inverse();
}

double motion_error(const Rigid3& found, const Rigid3& expected) {
  return std::max(rotation_error_rad(found, expected),
                  direction_error_rad(found.translation, expected.translation));
}

TEST(DecomposeHomography, TrueMotionIsAmongTheEight) {
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    const PlantedPlane plane = planted_plane(seed);
    const auto hypotheses = decompose_homography(pixel_homography(plane), kitti_camera());
    ASSERT_EQ(hypotheses.size(), 8U);
    double best = std::numeric_limits<double>::infinity();
    for (const Rigid3& hypothesis : hypotheses) {
      best = std::min(best, motion_error(hypothesis, plane.cur_from_prev));
    }
    EXPECT_LE(best, 1e-9) << "seed " << seed;
  }
}

TEST(DecomposeHomography, SignAndScaleDoNotMatter) {
  const PlantedPlane plane = planted_plane(3);
  for (const double scale : {-1.0, 1e-6, -3e5}) {
    double best = std::numeric_limits<double>::infinity();
    for (const Rigid3& hypothesis :
         decompose_homography(scale * pixel_homography(plane), kitti_camera())) {
      best = std::min(best, motion_error(hypothesis, plane.cur_from_prev));
    }
    EXPECT_LE(best, 1e-9) << "scale " << scale;
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

TEST(DecomposeHomography, SingularMatrixStaysFinite) {
  // A plane through the centre of the current camera: rank 2.
  PlantedPlane plane = planted_plane(5);
  plane.distance = plane.normal.dot(plane.cur_from_prev.inverse().translation);
  ASSERT_NEAR(euclidean_homography(plane).determinant(), 0.0, 1e-12);
  for (const Rigid3& hypothesis : decompose_homography(pixel_homography(plane), kitti_camera())) {
    EXPECT_THAT(hypothesis, IsFiniteMotion());
  }
}

TEST(DecomposeEssential, FourDifferentMotions) {
  const auto hypotheses = decompose_essential(essential_from_motion(SceneRandom(2).motion(0.5)));
  for (std::size_t i = 0; i < hypotheses.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      EXPECT_GT(motion_error(hypotheses[i], hypotheses[j]), 0.1);
    }
  }
}

TEST(DecomposeEssential, BrokenMatrixGivesNoNan) {
  const Eigen::Matrix3d zero = Eigen::Matrix3d::Zero();
  const Eigen::Matrix3d ones = Eigen::Matrix3d::Ones();
  for (const Eigen::Matrix3d& e : {zero, ones}) {
    for (const Rigid3& hypothesis : decompose_essential(e)) {
      EXPECT_THAT(hypothesis, IsFiniteMotion());
    }
  }
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
