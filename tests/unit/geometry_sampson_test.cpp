// SPDX-License-Identifier: MIT
// The residual of the refinement and its derivatives.
#include <cmath>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "geometry/decomposition.hpp"
#include "geometry/sampson.hpp"
#include "support/matchers.hpp"
#include "support/numeric_jacobian.hpp"
#include "support/synthetic_scene.hpp"

namespace stemvo {
namespace {

using testing::IsNear;
using testing::make_scene;
using testing::Scene;

using Vector6d = Eigen::Matrix<double, 6, 1>;

/// A camera with fx != fy, to catch a factor that is missing on one axis.
Camera uneven_camera() {
  Camera camera = testing::kitti_camera();
  camera.fy_px = 500.0;
  return camera;
}

Eigen::Vector3d squared_inverse_focal(const Camera& camera) {
  return {1.0 / (camera.fx_px * camera.fx_px), 1.0 / (camera.fy_px * camera.fy_px), 0.0};
}

TEST(SampsonTerm, IsTheTextbookDistanceInPixels) {
  const Scene scene = make_scene({.num_points = 50, .noise_px = 2.0, .seed = 4});
  const Camera camera = uneven_camera();
  const Eigen::Matrix3d f =
      fundamental_from_essential(essential_from_motion(scene.cur_from_prev), camera);
  for (std::size_t i = 0; i < scene.prev_uv.size(); ++i) {
    const Eigen::Vector3d line_in_cur = f * scene.prev_uv[i].homogeneous();
    const Eigen::Vector3d line_in_prev = f.transpose() * scene.cur_uv[i].homogeneous();
    const double expected =
        line_in_cur.dot(scene.cur_uv[i].homogeneous()) /
        std::sqrt(line_in_cur.head<2>().squaredNorm() + line_in_prev.head<2>().squaredNorm());
    const internal::SampsonTerm term = internal::sampson_term(
        scene.cur_from_prev.rotation_matrix(), scene.cur_from_prev.translation,
        squared_inverse_focal(camera), camera.normalize(scene.prev_uv[i]).homogeneous(),
        camera.normalize(scene.cur_uv[i]).homogeneous());
    EXPECT_NEAR(term.residual_px, expected, 1e-8 * (1.0 + std::abs(expected)));
  }
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
        testing::numeric_jacobian<1, 6>(residual, Vector6d(Vector6d::Zero())).transpose();
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
