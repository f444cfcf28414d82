// SPDX-License-Identifier: MIT
#include "geometry/median.hpp"
#include "geometry/pose_refinement.hpp"
#include "geometry/residuals.hpp"
#include "geometry/two_view_models.hpp"
#include "support/matchers.hpp"
#include "support/numeric_jacobian.hpp"
#include "support/synthetic_scene.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

using Points = std::vector<Eigen::Vector2d>;

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

double cost_at(const Scene& scene, const Rigid3& motion) {
  return refine_relative_pose(motion, {scene.prev_uv, scene.cur_uv}, scene.camera,
                              {.max_iterations = 0})
      .cost;
}

TEST(RefineRelativePose, ExactMatchesGiveTheExactMotion) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    const Scene scene = make_scene({.seed = seed});
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
      EXPECT_NEAR(cost_at(scene, result.cur_from_prev), result.cost, 1e-9 * (1.0 + result.cost));
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

TEST(RefineRelativePose, UnusableInputComesBackUnchanged) {
  const Scene scene = make_scene({.seed = 6});
  const std::span<const Eigen::Vector2d> prev(scene.prev_uv);
  const std::span<const Eigen::Vector2d> cur(scene.cur_uv);
  const Rigid3 start(scene.cur_from_prev.rotation, {0.1, 0.2, 0.9});
  const auto unchanged = [&](const RefinedMotion& result, const Rigid3& motion) {
    EXPECT_EQ(result.cur_from_prev.translation, motion.translation);
    EXPECT_EQ(result.cur_from_prev.rotation.coeffs(), motion.rotation.coeffs());
    EXPECT_EQ(result.cost, 0.0);
  };
  unchanged(refine_relative_pose(start, {{}, {}}, scene.camera), start);
  unchanged(refine_relative_pose(start, {prev.first(4), cur.first(4)}, scene.camera), start);
  const Rigid3 no_translation(start.rotation, Eigen::Vector3d::Zero());
  unchanged(refine_relative_pose(no_translation, {prev, cur}, scene.camera), no_translation);
  EXPECT_THROW(static_cast<void>(refine_relative_pose(start, {prev, {}}, scene.camera)),
               std::logic_error);
}

TEST(RefineRelativePose, DegenerateMatchesStayFinite) {
  const Scene scene = make_scene({.seed = 6});
  const Points same(200, Eigen::Vector2d(300.0, 100.0));
  Points line;
  const Points still = scene.prev_uv;
  for (int i = 0; i < 200; ++i) {
    line.emplace_back(5.0 * i, 2.0 * i);
  }
  const Rigid3 ahead(Eigen::Quaterniond::Identity(), Eigen::Vector3d::UnitZ());
  for (const Rigid3& start : {scene.cur_from_prev, ahead}) {
    for (const Points* points : std::initializer_list<const Points*>{&same, &line, &still}) {
      const RefinedMotion result = refine_relative_pose(start, {*points, *points}, scene.camera);
      EXPECT_THAT(result.cur_from_prev, IsFiniteMotion());
      EXPECT_TRUE(std::isfinite(result.cost));
    }
  }
}

Scene rotating_scene(SceneOptions options) {
  options.cur_from_prev = Rigid3(so3_exp({0.02, -0.06, 0.01}), Eigen::Vector3d::Zero());
  return make_scene(options);
}

Eigen::Quaterniond refined_rotation(const Scene& scene, const Eigen::Quaterniond& start) {
  return refine_rotation(start, {scene.prev_uv, scene.cur_uv}, scene.camera);
}

TEST(RefineRotation, ExactMatchesGiveTheExactRotation) {
  const Scene scene = rotating_scene({.seed = 3});
  const Eigen::Quaterniond found = refined_rotation(scene, Eigen::Quaterniond::Identity());
  EXPECT_LE(found.angularDistance(scene.cur_from_prev.rotation), 1e-9);
}

TEST(RefineRotation, NoiseAndOutliers) {
  std::vector<double> errors;
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    const Scene scene =
        rotating_scene({.num_points = 500, .noise_px = 0.3, .outlier_ratio = 0.2, .seed = seed});
    const Eigen::Quaterniond& truth = scene.cur_from_prev.rotation;
    errors.push_back(
        refined_rotation(scene, so3_exp({0.0, 0.01, 0.0}) * truth).angularDistance(truth));
  }
  EXPECT_LE(median(errors), 1.5e-4);
}

TEST(RefineRotation, DegenerateInputStaysFinite) {
  Scene scene = rotating_scene({.seed = 3});
  const std::span<const Eigen::Vector2d> prev(scene.prev_uv);
  const std::span<const Eigen::Vector2d> cur(scene.cur_uv);
  const Eigen::Quaterniond start = so3_exp({0.01, 0.0, 0.0});
  for (const std::size_t n : {0U, 1U}) {
    EXPECT_EQ(refine_rotation(start, {prev.first(n), cur.first(n)}, scene.camera).coeffs(),
              start.coeffs());
  }
  const Points same(200, Eigen::Vector2d(300.0, 100.0));
  EXPECT_TRUE(refine_rotation(start, {same, same}, scene.camera).coeffs().allFinite());
}

using Vector6d = Eigen::Matrix<double, 6, 1>;

/// A camera with fx != fy, to catch a factor that is missing on one axis.
Camera uneven_camera() {
  Camera camera = kitti_camera();
  camera.fy_px = 500.0;
  return camera;
}

Eigen::Vector3d squared_inverse_focal(const Camera& camera) {
  return {1.0 / (camera.fx_px * camera.fx_px), 1.0 / (camera.fy_px * camera.fy_px), 0.0};
}

TEST(SampsonTerm, DerivativesAgreeWithNumericOnes) {
  const Scene scene =
      make_scene({.num_points = 50, .noise_px = 2.0, .outlier_ratio = 0.2, .seed = 4});
  const Camera camera = uneven_camera();
  for (std::size_t i = 0; i < scene.prev_uv.size(); ++i) {
    const auto term_at = [&](const Vector6d& x) {
      const Eigen::Quaterniond rotation = so3_exp(x.head<3>()) * scene.cur_from_prev.rotation;
      return internal::sampson_term(
          rotation.toRotationMatrix(), scene.cur_from_prev.translation + x.tail<3>(),
          squared_inverse_focal(camera), camera.normalize(scene.prev_uv[i]).homogeneous(),
          camera.normalize(scene.cur_uv[i]).homogeneous());
    };
    const auto residual = [&](const Vector6d& x) {
      return Eigen::Matrix<double, 1, 1>(term_at(x).residual_px);
    };
    const Vector6d numeric =
        numeric_jacobian<1, 6>(residual, Vector6d(Vector6d::Zero())).transpose();
    const internal::SampsonTerm term = term_at(Vector6d::Zero());
    Vector6d analytic;
    analytic << term.by_rotation, term.by_translation;
    EXPECT_THAT(analytic, IsNear(numeric, 1e-6 * (1.0 + numeric.norm()))) << "match " << i;
  }
}

TEST(SampsonTerm, BothPointsAtTheEpipolesSayNothing) {
  const Eigen::Vector3d ahead = Eigen::Vector3d::UnitZ();
  const internal::SampsonTerm term = internal::sampson_term(
      Eigen::Matrix3d::Identity(), ahead, squared_inverse_focal(uneven_camera()), ahead, ahead);
  EXPECT_EQ(term.residual_px, 0.0);
  EXPECT_EQ(term.by_rotation.norm() + term.by_translation.norm(), 0.0);
}

}  // namespace
}  // namespace stemvo
