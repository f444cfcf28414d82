// SPDX-License-Identifier: MIT
// The point test: depth signs, reprojection, parallax.
#include "geometry/two_view_motion.hpp"
#include "support/synthetic_scene.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

using Points = std::vector<Eigen::Vector2d>;

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
  EXPECT_THROW(static_cast<void>(test_points(scene.cur_from_prev, {broken, {}}, scene.camera)),
               std::logic_error);
  const Rigid3 ahead(Eigen::Quaterniond::Identity(), {0.0, 0.6, -0.8});  // though all stand still
  EXPECT_EQ(test_points(ahead, {scene.prev_uv, scene.prev_uv}, scene.camera).parallax_deg, 0.0);
}

}  // namespace
}  // namespace stemvo
