// SPDX-License-Identifier: MIT
#include "stemvo/geometry/relative_pose_refinement.hpp"

#include <cmath>
#include <cstddef>
#include <vector>

#include "levenberg_marquardt.hpp"
#include "robust_loss.hpp"
#include "sampson.hpp"
#include "stemvo/check.hpp"

namespace stemvo {
namespace {

using Basis = Eigen::Matrix<double, 3, 2>;
using Vector5d = Eigen::Matrix<double, 5, 1>;

struct NormalizedMatch {
  Eigen::Vector3d prev;
  Eigen::Vector3d cur;
};

/// Two unit vectors that span the plane at right angles to a unit vector.
Basis tangent_basis(const Eigen::Vector3d& direction) {
  Basis basis;
  basis.col(0) = direction.unitOrthogonal();
  basis.col(1) = direction.cross(basis.col(0));
  return basis;
}

/// Matches that are not numbers are left out.
std::vector<NormalizedMatch> finite_matches(std::span<const Eigen::Vector2d> prev_uv,
                                            std::span<const Eigen::Vector2d> cur_uv,
                                            const Camera& camera) {
  std::vector<NormalizedMatch> matches;
  matches.reserve(prev_uv.size());
  for (std::size_t i = 0; i < prev_uv.size(); ++i) {
    const NormalizedMatch match{camera.normalize(prev_uv[i]).homogeneous(),
                                camera.normalize(cur_uv[i]).homogeneous()};
    if (match.prev.allFinite() && match.cur.allFinite()) {
      matches.push_back(match);
    }
  }
  return matches;
}

internal::NormalEquations<5> linearize(const Rigid3& motion,
                                       const std::vector<NormalizedMatch>& matches,
                                       const Camera& camera,
                                       double loss_scale_px) {
  const Eigen::Matrix3d rotation = motion.rotation_matrix();
  const Eigen::Matrix<double, 2, 3> to_tangent = tangent_basis(motion.translation).transpose();
  const Eigen::Vector3d squared_inverse_focal(1.0 / (camera.fx_px * camera.fx_px),
                                              1.0 / (camera.fy_px * camera.fy_px), 0.0);
  internal::NormalEquations<5> equations;
  internal::CauchyLoss loss(loss_scale_px);
  for (const NormalizedMatch& match : matches) {
    const internal::SampsonTerm term = internal::sampson_term(
        rotation, motion.translation, squared_inverse_focal, match.prev, match.cur);
    const double weight = loss.add(term.residual_px * term.residual_px);
    Vector5d jacobian;
    jacobian << term.by_rotation, to_tangent * term.by_translation;
    const Vector5d weighted = weight * jacobian;
    equations.hessian.noalias() += weighted * jacobian.transpose();
    equations.gradient += term.residual_px * weighted;
  }
  equations.cost = loss.sum();
  return equations;
}

Rigid3 retract(const Rigid3& motion, const Vector5d& step) {
  const Eigen::Vector3d tangent = tangent_basis(motion.translation) * step.tail<2>();
  // The rotation that carries the direction along the tangent keeps it on the sphere.
  const Eigen::Vector3d moved = so3_exp(motion.translation.cross(tangent)) * motion.translation;
  return {so3_exp(step.head<3>()) * motion.rotation, moved.normalized()};
}

}  // namespace

RelativePoseRefinement refine_relative_pose(const Rigid3& cur_from_prev,
                                            std::span<const Eigen::Vector2d> prev_uv,
                                            std::span<const Eigen::Vector2d> cur_uv,
                                            const Camera& camera,
                                            const RelativePoseRefinementOptions& options) {
  STEMVO_CHECK(prev_uv.size() == cur_uv.size(), "matches come in pairs");
  RelativePoseRefinement result;
  result.cur_from_prev = cur_from_prev;
  const std::vector<NormalizedMatch> matches = finite_matches(prev_uv, cur_uv, camera);
  const double length = cur_from_prev.translation.norm();
  const bool usable = std::isfinite(length) && length > 0.0 &&
                      cur_from_prev.rotation.coeffs().allFinite() && matches.size() >= 5;
  if (!usable) {
    return result;
  }
  Rigid3 motion(cur_from_prev.rotation, cur_from_prev.translation / length);
  const internal::MinimizationSummary summary = internal::minimize<5>(
      motion,
      [&](const Rigid3& state) { return linearize(state, matches, camera, options.loss_scale_px); },
      retract, options.max_iterations, options.step_tolerance);
  result.cur_from_prev = motion;
  result.initial_cost = summary.initial_cost;
  result.final_cost = summary.final_cost;
  result.num_iterations = summary.num_iterations;
  return result;
}

}  // namespace stemvo
