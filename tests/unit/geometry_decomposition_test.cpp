// SPDX-License-Identifier: MIT
#include "geometry/decomposition.hpp"
#include "support/matchers.hpp"
#include "support/synthetic_scene.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

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
