// SPDX-License-Identifier: MIT
#include "geometry/pose_influence.hpp"

#include <algorithm>
#include <cstddef>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "geometry/minimize.hpp"
#include "geometry/residuals.hpp"

namespace stemvo {
namespace {

/// A point's hold on the pose leaves no less than this to the others.
constexpr double kLeastFree = 1e-6;

/// A direction that nothing tells keeps a billionth of the scale of its unknown, so that the result
/// is finite.
template <int N>
Eigen::Matrix<double, N, N> inverse_of(const Eigen::Matrix<double, N, N>& information) {
  using Matrix = Eigen::Matrix<double, N, N>;
  const Eigen::Matrix<double, N, 1> scale =
      (information.diagonal().array() + 1e-12).sqrt().inverse();
  Matrix scaled = scale.asDiagonal() * information * scale.asDiagonal();
  scaled.diagonal().array() += 1e-9;
  const Matrix inverse = scaled.ldlt().solve(Matrix::Identity());
  return scale.asDiagonal() * inverse * scale.asDiagonal();
}

}  // namespace

Matrix6d adjoint(const Rigid3& b_from_a) {
  const Eigen::Matrix3d rotation = b_from_a.rotation_matrix();
  Matrix6d result = Matrix6d::Zero();
  result.topLeftCorner<3, 3>() = rotation;
  result.topRightCorner<3, 3>() = skew(b_from_a.translation) * rotation;
  result.bottomRightCorner<3, 3>() = rotation;
  return result;
}

PoseInfluences pose_influences(const Rigid3& camera_from_world,
                               std::span<const Eigen::Vector3d> points_in_world,
                               std::span<const Eigen::Vector2d> uv,
                               const Camera& camera,
                               double loss_scale_px) {
  struct Pull {
    std::size_t point = 0;
    Eigen::Matrix<double, 6, 2> jacobian;  ///< transposed, times the weight
    Eigen::Vector2d error;
  };
  const Eigen::Matrix3d rotation = camera_from_world.rotation_matrix();
  std::vector<Pull> pulls;
  pulls.reserve(points_in_world.size());
  Matrix6d curvature = Matrix6d::Zero();
  CauchyLoss loss(loss_scale_px);
  for (std::size_t i = 0; i < points_in_world.size(); ++i) {
    const Eigen::Vector3d x = rotation * points_in_world[i] + camera_from_world.translation;
    if (!(x.z() > internal::kMinDepth)) {
      continue;
    }
    const internal::ReprojectionTerm term = internal::reprojection_term(x, uv[i], camera);
    const double weight = loss.add(term.error.squaredNorm());
    Pull pull{.point = i, .jacobian = {}, .error = term.error};
    pull.jacobian << weight * term.jacobian.bottomRows<3>(), weight * term.jacobian.topRows<3>();
    // The slope of Cauchy's pull, mean over the directions of an error, is the weight squared.
    curvature.noalias() += pull.jacobian * pull.jacobian.transpose();
    pulls.push_back(pull);
  }
  PoseInfluences result;
  result.covariance = inverse_of<6>(curvature);
  result.of_point.assign(points_in_world.size(), Vector6d::Zero());
  for (const Pull& pull : pulls) {
    const Eigen::Matrix<double, 6, 2> gain = result.covariance * pull.jacobian;
    const Eigen::Matrix2d free =
        (1.0 + kLeastFree) * Eigen::Matrix2d::Identity() - pull.jacobian.transpose() * gain;
    result.of_point[pull.point] = gain * (free.inverse() * pull.error);
  }
  return result;
}

Matrix6d relative_pose_covariance(const Rigid3& cur_from_prev,
                                  const PixelPairs& pairs,
                                  const Camera& camera,
                                  double loss_scale_px) {
  using Vector5d = Eigen::Matrix<double, 5, 1>;
  using Matrix5d = Eigen::Matrix<double, 5, 5>;
  const Eigen::Matrix3d rotation = cur_from_prev.rotation_matrix();
  const Eigen::Vector3d& direction = cur_from_prev.translation;
  const Eigen::Matrix<double, 3, 2> tangent = internal::tangent_basis(direction);
  const Eigen::Vector3d squared_inverse_focal(1.0 / (camera.fx_px * camera.fx_px),
                                              1.0 / (camera.fy_px * camera.fy_px), 0.0);
  struct Pull {
    Vector5d jacobian;
    double slope = 0.0;  ///< of the pull of Cauchy's loss
    double pull_px = 0.0;
  };
  std::vector<Pull> pulls;
  Matrix5d curvature = Matrix5d::Zero();
  CauchyLoss loss(loss_scale_px);
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const internal::SampsonTerm term =
        internal::sampson_term(rotation, direction, squared_inverse_focal,
                               camera.normalize(pairs.prev_uv[i]).homogeneous(),
                               camera.normalize(pairs.cur_uv[i]).homogeneous());
    const double weight = loss.add(term.residual_px * term.residual_px);
    Pull pull;
    pull.jacobian << tangent.transpose() * term.by_translation, term.by_rotation;
    pull.slope = std::max(weight * (2.0 * weight - 1.0), 0.0);
    pull.pull_px = weight * term.residual_px;
    curvature.noalias() += pull.slope * pull.jacobian * pull.jacobian.transpose();
    pulls.push_back(pull);
  }
  const Matrix5d inverse = inverse_of<5>(curvature);
  Matrix5d covariance = Matrix5d::Zero();
  for (const Pull& pull : pulls) {
    const Vector5d gain = inverse * pull.jacobian;
    const double free = 1.0 + kLeastFree - pull.slope * pull.jacobian.dot(gain);
    const Vector5d influence = gain * (pull.pull_px / free);
    covariance.noalias() += influence * influence.transpose();
  }
  // The true cur_from_prev is (exp(w), v) cur_from_prev.
  Eigen::Matrix<double, 6, 5> to_error = Eigen::Matrix<double, 6, 5>::Zero();
  to_error.topLeftCorner<3, 2>() = tangent;
  to_error.topRightCorner<3, 3>() = skew(direction);
  to_error.bottomRightCorner<3, 3>().setIdentity();
  return to_error * covariance * to_error.transpose();
}

}  // namespace stemvo
