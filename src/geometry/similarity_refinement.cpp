// SPDX-License-Identifier: MIT
#include "geometry/similarity_refinement.hpp"

#include <cmath>
#include <cstddef>
#include <limits>

#include "geometry/cauchy_loss.hpp"
#include "geometry/minimize.hpp"
#include "geometry/reprojection.hpp"

namespace stemvo {
namespace {

constexpr std::size_t kMinPoints = 4;
constexpr double kTolerance = 1e-7;
/// Error of a point behind the camera.
constexpr double kBehind_px = 1e3;

using Matrix7d = Eigen::Matrix<double, 7, 7>;
using Vector7d = Eigen::Matrix<double, 7, 1>;

/// Adds where a camera sees x, a point that moves with the unknowns by `x_by_step`.
void add_observation(const Eigen::Vector3d& x,
                     const Eigen::Matrix<double, 3, 7>& x_by_step,
                     const Eigen::Vector2d& uv,
                     const Camera& camera,
                     CauchyLoss& loss,
                     QuadraticModel<7>& equations) {
  if (!(x.z() > internal::kMinDepth)) {
    loss.add(kBehind_px * kBehind_px);
    return;
  }
  const internal::ReprojectionTerm at = internal::reprojection_term(x, uv, camera);
  const Eigen::Matrix<double, 2, 7> jacobian = at.jacobian.bottomRows<3>().transpose() * x_by_step;
  const double weight = loss.add(at.error.squaredNorm());
  equations.hessian.noalias() += weight * jacobian.transpose() * jacobian;
  equations.gradient.noalias() += weight * jacobian.transpose() * at.error;
}

/// Unknowns: w, v, q of x_a = exp(w) R exp(q) s x_b + t + v.
QuadraticModel<7> linearize_similarity(const Similarity3& a_from_b,
                                       const CrossObservations& seen,
                                       double loss_scale_px) {
  const Eigen::Matrix3d rotation = a_from_b.rotation.toRotationMatrix();
  QuadraticModel<7> equations;
  CauchyLoss loss(loss_scale_px);
  Eigen::Matrix<double, 3, 7> by_step;
  for (const CrossObservation& observation : seen.of_b) {
    const Eigen::Vector3d turned = a_from_b.scale * (rotation * observation.point);
    by_step << -skew(turned), Eigen::Matrix3d::Identity(), turned;
    add_observation(turned + a_from_b.translation, by_step, observation.uv, seen.a, loss,
                    equations);
  }
  // The view b has of a's points does not depend on the scale: lengths are a's here.
  for (const CrossObservation& observation : seen.of_a) {
    const Eigen::Vector3d moved = observation.point - a_from_b.translation;
    by_step << rotation.transpose() * skew(moved), -rotation.transpose(), Eigen::Vector3d::Zero();
    add_observation(rotation.transpose() * moved, by_step, observation.uv, seen.b, loss, equations);
  }
  equations.cost = loss.sum();
  return equations;
}

Similarity3 move_similarity(const Similarity3& a_from_b, const Vector7d& step) {
  return {a_from_b.scale * std::exp(step[6]), so3_exp(step.head<3>()) * a_from_b.rotation,
          a_from_b.translation + step.segment<3>(3)};
}

}  // namespace

RefinedSimilarity refine_similarity(const Similarity3& a_from_b,
                                    const CrossObservations& seen,
                                    const RefinementOptions& options) {
  RefinedSimilarity refined{a_from_b};
  if (seen.of_a.size() < kMinPoints || seen.of_b.size() < kMinPoints) {
    refined.covariance.diagonal().setConstant(std::numeric_limits<double>::infinity());
    return refined;
  }
  const auto linearize = [&](const Similarity3& state) {
    return linearize_similarity(state, seen, options.loss_scale_px);
  };
  minimize<7>(refined.a_from_b, linearize, move_similarity, options.max_iterations, kTolerance);
  refined.covariance = linearize(refined.a_from_b).hessian.ldlt().solve(Matrix7d::Identity());
  return refined;
}

}  // namespace stemvo
