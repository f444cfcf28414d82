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
  const Rigid3 motion(Eigen::Quaterniond::Identity(), {1.0, 0.0, 0.0});
  const Scene scene =
      make_scene({.seed = 2, .min_depth = 1e3, .max_depth = 1e4, .cur_from_prev = motion});
  const Rigid3 opposite(motion.rotation, -motion.translation);
  for (const Rigid3& m : {motion, opposite}) {
    const PointTest result = test_points(m, {scene.prev_uv, scene.cur_uv}, scene.camera);
    EXPECT_EQ(result.num_good, 200);
    EXPECT_LT(result.parallax_deg, 0.1);
  }
}

TEST(TestPoints, ReprojectionBoundIsTwoSigmaInEitherImage) {
  // Sideways motion: rows are epipolar lines; a row difference is shared by the two images.
  const Rigid3 motion(Eigen::Quaterniond::Identity(), {1.0, 0.0, 0.0});
  const Points prev(4, Eigen::Vector2d(600.0, 180.0));
  const Points cur = {{650.0, 180.0}, {650.0, 183.9}, {650.0, 184.1}, {650.0, 192.1}};
  EXPECT_THAT(test_points(motion, {prev, cur}, kitti_camera()).good_mask,
              ::testing::ElementsAre(1, 1, 0, 0));
  EXPECT_THAT(test_points(motion, {prev, cur}, kitti_camera(), {.sigma_px = 3.0}).good_mask,
              ::testing::ElementsAre(1, 1, 1, 0));
}

TEST(TestPoints, BoundIsInPixelsOfEachAxisWhereFocalLengthsDiffer) {
  Camera camera = kitti_camera();
  camera.fy_px = 3.0 * camera.fx_px;
  const Rigid3 sideways(Eigen::Quaterniond::Identity(), {1.0, 0.0, 0.0});
  const Points prev(2, Eigen::Vector2d(600.0, 180.0));
  const Points cur = {{650.0, 183.9}, {650.0, 184.1}};
  EXPECT_THAT(test_points(sideways, {prev, cur}, camera).good_mask, ::testing::ElementsAre(1, 0));
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

TEST(Triangulate, ExactMatchesGiveTheExactPoint) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const Scene scene = make_scene({.num_points = 50, .seed = seed});
    for (std::size_t i = 0; i < scene.prev_uv.size(); ++i) {
      const Eigen::Vector3d& truth = scene.points_in_prev[i];
      const TriangulatedPoint point =
          triangulate(scene.cur_from_prev, scene.camera.normalize(scene.prev_uv[i]),
                      scene.camera.normalize(scene.cur_uv[i]));
      ASSERT_TRUE(point.finite);
      // Near the epipole the rays are almost parallel: rounding counts 1 / parallax times.
      const double parallax = std::acos(std::min(point.cos_parallax, 1.0));
      EXPECT_THAT(point.in_prev, IsNear(truth, 1e-12 * truth.norm() / parallax));
      const Eigen::Vector3d from_cur = truth - scene.cur_from_prev.inverse().translation;
      EXPECT_NEAR(point.cos_parallax, truth.normalized().dot(from_cur.normalized()), 1e-12);
    }
  }
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
  const Rigid3 sideways(Eigen::Quaterniond::Identity(), {1.0, 0.0, 0.0});
  const Rigid3 forward(Eigen::Quaterniond::Identity(), {0.0, 0.0, -1.0});
  const Eigen::Vector2d center(0.0, 0.0);
  const Eigen::Vector2d side(0.3, 0.1);
  for (const TriangulatedPoint& point :
       {triangulate(sideways, side, side), triangulate(Rigid3(), side, side),
        triangulate(Rigid3(), side, center), triangulate(forward, center, center)}) {
    EXPECT_FALSE(point.finite);
  }
}

}  // namespace
}  // namespace stemvo
