// SPDX-License-Identifier: MIT
#include "geometry/triangulation.hpp"
#include "stemvo/camera.hpp"
#include "support/matchers.hpp"
#include "support/synthetic_scene.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

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

TEST(Triangulate, PointBehindTheCamerasIsFoundThere) {
  const Rigid3 motion(so3_exp({0.0, 0.05, 0.0}), {1.0, 0.1, 0.2});
  const Eigen::Vector3d behind(1.0, 2.0, -10.0);
  const TriangulatedPoint point = triangulate(motion, image(behind), image(motion * behind));
  ASSERT_TRUE(point.finite);
  EXPECT_THAT(point.in_prev, IsNear(behind, 1e-10));
}

TEST(Triangulate, ScaleFollowsTheTranslation) {
  const Eigen::Vector3d truth(1.0, 2.0, 10.0);
  const Rigid3 motion(so3_exp({0.0, 0.05, 0.0}), {1.0, 0.1, 0.2});
  const Rigid3 longer(motion.rotation, 3.0 * motion.translation);
  EXPECT_THAT(triangulate(longer, image(truth), image(motion * truth)).in_prev,
              IsNear(3.0 * truth, 1e-10));
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
