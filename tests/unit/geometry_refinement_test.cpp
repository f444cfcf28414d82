// SPDX-License-Identifier: MIT
#include "geometry/median.hpp"
#include "geometry/pose_refinement.hpp"
#include "geometry/two_view_models.hpp"
#include "support/matchers.hpp"
#include "support/synthetic_scene.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

/// The truth turned by rotation_rad and with its direction turned by direction_rad.
Rigid3 disturbed(const Scene& scene, double rotation_rad, double direction_rad) {
  SceneRandom random(77);
  const Eigen::Vector3d& t = scene.cur_from_prev.translation;
  const Eigen::Vector3d axis = t.cross(random.direction()).normalized();
  return {so3_exp(rotation_rad * random.direction()) * scene.cur_from_prev.rotation,
          so3_exp(direction_rad * axis) * t};
}

RefinedMotion refine(const Scene& scene, const Rigid3& start) {
  return refine_relative_pose(start, {scene.prev_uv, scene.cur_uv}, scene.camera);
}

TEST(RefineRelativePose, ExactMatchesGiveTheExactMotion) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    Camera camera = kitti_camera();
    camera.fy_px *= seed % 2 == 0 ? 0.7 : 1.0;
    const Scene scene = make_scene({.camera = camera, .seed = seed});
    const RefinedMotion result = refine(scene, disturbed(scene, 0.02, 0.1));
    EXPECT_LE(rotation_error_rad(result.cur_from_prev, scene.cur_from_prev), 1e-6) << seed;
    EXPECT_LE(
        direction_error_rad(result.cur_from_prev.translation, scene.cur_from_prev.translation),
        1e-6)
        << seed;
    EXPECT_LE(result.cost, 1e-9);
  }
}

struct MedianErrors {
  double rotation_rad = 0.0;
  double direction_rad = 0.0;
};

MedianErrors median_errors(SceneOptions options) {
  std::vector<double> rotation;
  std::vector<double> direction;
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    options.seed = seed;
    const Scene scene = make_scene(options);
    const Rigid3 found = refine(scene, disturbed(scene, 0.005, 0.05)).cur_from_prev;
    rotation.push_back(rotation_error_rad(found, scene.cur_from_prev));
    direction.push_back(direction_error_rad(found.translation, scene.cur_from_prev.translation));
  }
  return {median(rotation), median(direction)};
}

TEST(RefineRelativePose, NoiseIsAveragedOut) {
  const MedianErrors errors = median_errors({.num_points = 500, .noise_px = 0.3});
  EXPECT_LE(errors.rotation_rad, 3e-4);
  EXPECT_LE(errors.direction_rad, 2e-3);
  // A tenth of the noise, about a tenth of the error.
  const MedianErrors small = median_errors({.num_points = 500, .noise_px = 0.03});
  EXPECT_LE(small.rotation_rad, 3e-5);
  EXPECT_LE(small.direction_rad, 2e-4);
}

TEST(RefineRelativePose, CostNeverRises) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    const Scene scene =
        make_scene({.num_points = 60, .noise_px = 1.0, .outlier_ratio = 0.5, .seed = seed});
    for (const double start_error : {0.0, 0.01, 0.3, 2.0}) {
      const Rigid3 start = disturbed(scene, start_error, start_error);
      double last_cost = std::numeric_limits<double>::infinity();
      for (const int max_iterations : {0, 1, 20}) {
        const RefinedMotion result = refine_relative_pose(
            start, {scene.prev_uv, scene.cur_uv}, scene.camera, {.max_iterations = max_iterations});
        EXPECT_TRUE(std::isfinite(result.cost));
        EXPECT_LE(result.cost, last_cost);
        last_cost = result.cost;
        EXPECT_NEAR(result.cur_from_prev.translation.norm(), 1.0, 1e-12);
        EXPECT_NEAR(result.cur_from_prev.rotation.norm(), 1.0, 1e-12);
      }
      // The reported cost is that of the reported motion.
      const RefinedMotion result = refine(scene, start);
      const RefinedMotion same = refine_relative_pose(
          result.cur_from_prev, {scene.prev_uv, scene.cur_uv}, scene.camera, {.max_iterations = 0});
      EXPECT_NEAR(same.cost, result.cost, 1e-9 * (1.0 + result.cost));
    }
  }
}

TEST(RefineRelativePose, CostIsTheRobustSampsonDistanceInPixels) {
  // So many wrong matches that the product of the loss's terms needs several logarithms.
  const Scene scene =
      make_scene({.num_points = 400, .noise_px = 1.0, .outlier_ratio = 0.5, .seed = 4});
  Camera camera = scene.camera;
  camera.fy_px = 500.0;
  const Eigen::Matrix3d f =
      fundamental_from_essential(essential_from_motion(scene.cur_from_prev), camera);
  double expected = 0.0;
  for (std::size_t i = 0; i < scene.prev_uv.size(); ++i) {
    const Eigen::Vector3d in_cur = f * scene.prev_uv[i].homogeneous();
    const Eigen::Vector3d in_prev = f.transpose() * scene.cur_uv[i].homogeneous();
    const double residual = in_cur.dot(scene.cur_uv[i].homogeneous());
    const double squared =
        residual * residual / (in_cur.head<2>().squaredNorm() + in_prev.head<2>().squaredNorm());
    expected += 0.7 * 0.7 * std::log1p(squared / (0.7 * 0.7));
  }
  const RefinedMotion result =
      refine_relative_pose(scene.cur_from_prev, {scene.prev_uv, scene.cur_uv}, camera,
                           {.loss_scale_px = 0.7, .max_iterations = 0});
  EXPECT_NEAR(result.cost, expected, 1e-9 * expected);
}

TEST(RefineRotation, NoiseAndOutliers) {
  const Rigid3 turn(so3_exp({0.02, -0.06, 0.01}), Eigen::Vector3d::Zero());
  std::vector<double> errors;
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    const Scene scene = make_scene({.num_points = 500,
                                    .noise_px = 0.3,
                                    .outlier_ratio = 0.2,
                                    .seed = seed,
                                    .cur_from_prev = turn});
    const Eigen::Quaterniond found = refine_rotation(so3_exp({0.0, 0.01, 0.0}) * turn.rotation,
                                                     {scene.prev_uv, scene.cur_uv}, scene.camera);
    errors.push_back(found.angularDistance(turn.rotation));
  }
  EXPECT_LE(median(errors), 1.5e-4);
}

}  // namespace
}  // namespace stemvo
