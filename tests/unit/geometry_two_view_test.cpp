// SPDX-License-Identifier: MIT
#include "geometry/triangulation.hpp"
#include "geometry/two_view_models.hpp"
#include "stemvo/camera.hpp"
#include "support/matchers.hpp"
#include "support/synthetic_scene.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

using Points = std::vector<Eigen::Vector2d>;

const Rigid3 kSideways(Eigen::Quaterniond::Identity(), {1.0, 0.0, 0.0});

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
  EXPECT_THAT(score.inlier_mask, ::testing::ElementsAre(0));
}

TEST(ScoreFundamental, HandWorked) {
  const Points prev = {{0.0, 0.0}, {100.0, 50.0}, {200.0, 80.0}, {10.0, 20.0}};
  // Rows differ by 0, 1, 1.9 and 2 px: the last is past sqrt(3.841) = 1.96.
  const Points cur = {{50.0, 0.0}, {20.0, 51.0}, {203.0, 78.1}, {900.0, 22.0}};
  const ModelScore score = score_fundamental(row_fundamental(), {prev, cur}, 1.0);
  EXPECT_NEAR(score.score, 2.0 * (3.0 * 5.991 - 0.0 - 1.0 - 3.61), 1e-9);
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

TEST(MotionFromEssential, ExactMatchesGiveTheTrueMotion) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    const Scene scene = make_scene({.seed = seed});
    const double scale = seed % 2 == 0 ? -4.0 : 0.3;  // of a matrix that has none
    const auto hypotheses = decompose_essential(scale * essential_from_motion(scene.cur_from_prev));
    const auto motion = best_motion(TwoViewModel::kEssential, hypotheses,
                                    {scene.prev_uv, scene.cur_uv}, scene.camera)
                            .value();
    EXPECT_THAT(motion.cur_from_prev, IsNearMotion(scene.cur_from_prev, 1e-9));
    EXPECT_EQ(motion.test.num_good, 200);
    EXPECT_EQ(motion.model, TwoViewModel::kEssential);
    EXPECT_TRUE(is_decisive(motion, 200)) << "seed " << seed;
  }
}

TEST(MotionFromHomography, AllPointsPassAndTheTrueMotionIsOneOfTheBest) {
  int num_true = 0;
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    const Scene scene = make_scene({.planar = true, .seed = seed});
    const auto hypotheses = decompose_homography(true_homography(scene), scene.camera);
    const auto motion = best_motion(TwoViewModel::kHomography, hypotheses,
                                    {scene.prev_uv, scene.cur_uv}, scene.camera)
                            .value();
    EXPECT_EQ(motion.model, TwoViewModel::kHomography);
    EXPECT_EQ(motion.test.num_good, 200);
    EXPECT_EQ(std::ranges::count(motion.test.good_mask, 1), 200);
    const bool is_true =
        ::testing::Matches(IsNearMotion(scene.cur_from_prev, 1e-8))(motion.cur_from_prev);
    num_true += is_true ? 1 : 0;
    // A plane allows two motions in front of which all points lie: then the choice is a guess,
    // and must be called one.
    if (!is_true) {
      EXPECT_EQ(motion.runner_up_ratio, 1.0) << "seed " << seed;
      EXPECT_FALSE(is_decisive(motion, 200));
    }
  }
  EXPECT_GE(num_true, 25);
}

TEST(IsDecisive, EveryCriterionCounts) {
  TwoViewMotion good;
  good.model = TwoViewModel::kEssential;
  good.test.num_good = 95;
  good.test.parallax_deg = 1.5;
  good.runner_up_ratio = 0.3;
  EXPECT_TRUE(is_decisive(good, 100));
  EXPECT_FALSE(is_decisive(good, 106)) << "below the share";
  EXPECT_FALSE(is_decisive(good, 100, {.min_good = 96}));
  EXPECT_FALSE(is_decisive(good, 100, {.min_parallax_deg = 1.6}));
  EXPECT_FALSE(is_decisive(TwoViewMotion(), 0)) << "no model";
  good.runner_up_ratio = 0.72;
  EXPECT_FALSE(is_decisive(good, 100)) << "0.7 for E";
  good.model = TwoViewModel::kHomography;
  EXPECT_TRUE(is_decisive(good, 100)) << "0.75 for H";
  good.runner_up_ratio = 0.76;
  EXPECT_FALSE(is_decisive(good, 100));
  good.runner_up_ratio = 0.3;
  good.test.parallax_deg = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(is_decisive(good, 100)) << "NaN";
}

TEST(TestPoints, FarPointsCannotVoteOnTheSign) {
  const Scene scene =
      make_scene({.seed = 2, .min_depth = 1e3, .max_depth = 1e4, .cur_from_prev = kSideways});
  for (const Rigid3& m : {kSideways, kSideways.inverse()}) {
    const PointTest result = test_points(m, {scene.prev_uv, scene.cur_uv}, scene.camera);
    EXPECT_EQ(result.num_good, 200);
    EXPECT_LT(result.parallax_deg, 0.1);
  }
}

TEST(TestPoints, ReprojectionBoundIsTwoSigmaInEitherImage) {
  // Sideways motion: rows are epipolar lines; a row difference is shared by the two images.
  const Points prev(4, Eigen::Vector2d(600.0, 180.0));
  const Points cur = {{650.0, 180.0}, {650.0, 183.9}, {650.0, 184.1}, {650.0, 192.1}};
  EXPECT_THAT(test_points(kSideways, {prev, cur}, kitti_camera()).good_mask,
              ::testing::ElementsAre(1, 1, 0, 0));
  EXPECT_THAT(test_points(kSideways, {prev, cur}, kitti_camera(), {.sigma_px = 3.0}).good_mask,
              ::testing::ElementsAre(1, 1, 1, 0));
}

TEST(TestPoints, BoundIsInPixelsOfEachAxisWhereFocalLengthsDiffer) {
  Camera camera = kitti_camera();
  camera.fy_px = 3.0 * camera.fx_px;
  const Points prev(2, Eigen::Vector2d(600.0, 180.0));
  const Points cur = {{650.0, 183.9}, {650.0, 184.1}};
  EXPECT_THAT(test_points(kSideways, {prev, cur}, camera).good_mask, ::testing::ElementsAre(1, 0));
}

TEST(TestPoints, ParallaxIsThatOfTheFiftyFirstPoint) {
  // Two cameras one metre apart look at points straight ahead of their middle.
  const Rigid3 motion(Eigen::Quaterniond::Identity(), {-1.0, 0.0, 0.0});
  const Camera camera = kitti_camera();
  Points prev;
  Points cur;
  for (int i = 0; i < 80; ++i) {
    const Eigen::Vector3d point(0.5, 0.0, 5.0 + i);
    prev.push_back(camera.project(point));
    cur.push_back(camera.project(motion * point));
  }
  const auto parallax_deg = [](double depth) { return 2.0 * std::atan(0.5 / depth) / kDeg; };
  EXPECT_NEAR(test_points(motion, {prev, cur}, camera).parallax_deg, parallax_deg(55.0), 1e-6);
  prev.resize(10);
  cur.resize(10);
  EXPECT_NEAR(test_points(motion, {prev, cur}, camera).parallax_deg, parallax_deg(14.0), 1e-6);
}

TEST(TestPoints, DegenerateInputGivesNoGoodPointAndNoNan) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Scene scene = make_scene({.seed = 3});
  const Points broken(200, Eigen::Vector2d(nan, 100.0));
  const auto test = [&](const Rigid3& motion, const Points& prev, const Points& cur) {
    const PointTest result = test_points(motion, {prev, cur}, scene.camera);
    EXPECT_EQ(result.parallax_deg, 0.0);
    EXPECT_EQ(result.num_good, 0);
    EXPECT_EQ(result.good_mask.size(), prev.size());
  };
  const Rigid3 rotation_only(scene.cur_from_prev.rotation, Eigen::Vector3d::Zero());
  Rigid3 with_nan = scene.cur_from_prev;
  with_nan.translation.x() = nan;
  test(scene.cur_from_prev, {}, {});
  test(scene.cur_from_prev, broken, scene.cur_uv);
  test(scene.cur_from_prev, scene.prev_uv, broken);
  test(rotation_only, scene.prev_uv, scene.cur_uv);
  test(with_nan, scene.prev_uv, scene.cur_uv);
  EXPECT_EQ(test_points(scene.cur_from_prev, {scene.prev_uv, scene.cur_uv}, Camera{}).num_good, 0);
  const Rigid3 ahead(Eigen::Quaterniond::Identity(), {0.0, 0.6, -0.8});  // though all stand still
  EXPECT_EQ(test_points(ahead, {scene.prev_uv, scene.prev_uv}, scene.camera).parallax_deg, 0.0);
}

Eigen::Vector2d image(const Eigen::Vector3d& point) { return point.hnormalized(); }

double squared_reprojection(const Rigid3& cur_from_prev,
                            const Eigen::Vector3d& point,
                            const Eigen::Vector2d& prev,
                            const Eigen::Vector2d& cur) {
  return (image(point) - prev).squaredNorm() + (image(cur_from_prev * point) - cur).squaredNorm();
}

TEST(Triangulate, NoisyMatchesGiveTheLeastReprojectionError) {
  const Scene scene = make_scene({.num_points = 300, .noise_px = 1.0, .seed = 7});
  for (std::size_t i = 0; i < scene.prev_uv.size(); ++i) {
    const Eigen::Vector2d prev = scene.camera.normalize(scene.prev_uv[i]);
    const Eigen::Vector2d cur = scene.camera.normalize(scene.cur_uv[i]);
    const TriangulatedPoint point = triangulate(scene.cur_from_prev, prev, cur);
    ASSERT_TRUE(point.finite);
    const double error = squared_reprojection(scene.cur_from_prev, point.in_prev, prev, cur);
    for (int axis = 0; axis < 3; ++axis) {
      for (const double step : {-1e-3, 1e-3}) {
        const Eigen::Vector3d moved =
            point.in_prev + step * point.in_prev.norm() * Eigen::Vector3d::Unit(axis);
        EXPECT_LE(error, squared_reprojection(scene.cur_from_prev, moved, prev, cur) + 1e-12);
      }
    }
  }
}

TEST(Triangulate, WithoutMeetingRaysNothingIsFinite) {
  const Rigid3 forward(Eigen::Quaterniond::Identity(), {0.0, 0.0, -1.0});
  const Eigen::Vector2d center(0.0, 0.0);
  const Eigen::Vector2d side(0.3, 0.1);
  for (const TriangulatedPoint& point :
       {triangulate(kSideways, side, side), triangulate(Rigid3(), side, side),
        triangulate(Rigid3(), side, center), triangulate(forward, center, center)}) {
    EXPECT_FALSE(point.finite);
  }
}

}  // namespace
}  // namespace stemvo
