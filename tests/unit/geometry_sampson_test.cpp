// SPDX-License-Identifier: MIT
// The residual of the refinement and its derivatives.
#include "geometry/decomposition.hpp"
#include "geometry/sampson.hpp"
#include "support/matchers.hpp"
#include "support/numeric_jacobian.hpp"
#include "support/synthetic_scene.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

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
