// SPDX-License-Identifier: MIT
#include <cstddef>
#include <vector>

#include "levenberg_marquardt.hpp"
#include "robust_loss.hpp"
#include "stemvo/check.hpp"
#include "stemvo/geometry/relative_pose_refinement.hpp"

namespace stemvo {
namespace {

struct RayPair {
  Eigen::Vector3d prev;  ///< unit viewing rays
  Eigen::Vector3d cur;
};

std::vector<RayPair> finite_rays(std::span<const Eigen::Vector2d> prev_uv,
                                 std::span<const Eigen::Vector2d> cur_uv,
                                 const Camera& camera) {
  std::vector<RayPair> pairs;
  pairs.reserve(prev_uv.size());
  for (std::size_t i = 0; i < prev_uv.size(); ++i) {
    const RayPair pair{camera.normalize(prev_uv[i]).homogeneous().normalized(),
                       camera.normalize(cur_uv[i]).homogeneous().normalized()};
    if (pair.prev.allFinite() && pair.cur.allFinite()) {
      pairs.push_back(pair);
    }
  }
  return pairs;
}

/// Residual f (cur - R prev) of unit rays: the angle in px, without the singularity of a
/// projection. Its Jacobian for R <- exp(w) R is f [R prev]x.
internal::NormalEquations<3> linearize(const Eigen::Quaterniond& rotation,
                                       const std::vector<RayPair>& pairs,
                                       double focal_px,
                                       double loss_scale_px) {
  const Eigen::Matrix3d r = rotation.toRotationMatrix();
  const double squared_focal = focal_px * focal_px;
  internal::NormalEquations<3> equations;
  internal::CauchyLoss loss(loss_scale_px);
  for (const RayPair& pair : pairs) {
    const Eigen::Vector3d y = r * pair.prev;
    const double weight = squared_focal * loss.add(squared_focal * (pair.cur - y).squaredNorm());
    equations.hessian += weight * (Eigen::Matrix3d::Identity() - y * y.transpose());
    equations.gradient += weight * pair.cur.cross(y);
  }
  equations.cost = loss.sum();
  return equations;
}

}  // namespace

RelativePoseRefinement refine_rotation(const Rigid3& cur_from_prev,
                                       std::span<const Eigen::Vector2d> prev_uv,
                                       std::span<const Eigen::Vector2d> cur_uv,
                                       const Camera& camera,
                                       const RelativePoseRefinementOptions& options) {
  STEMVO_CHECK(prev_uv.size() == cur_uv.size(), "matches come in pairs");
  RelativePoseRefinement result;
  result.cur_from_prev.rotation = cur_from_prev.rotation;
  const std::vector<RayPair> pairs = finite_rays(prev_uv, cur_uv, camera);
  if (pairs.size() < 2 || !cur_from_prev.rotation.coeffs().allFinite()) {
    return result;
  }
  Eigen::Quaterniond rotation = cur_from_prev.rotation.normalized();
  const internal::MinimizationSummary summary = internal::minimize<3>(
      rotation,
      [&](const Eigen::Quaterniond& state) {
        return linearize(state, pairs, camera.mean_focal_px(), options.loss_scale_px);
      },
      [](const Eigen::Quaterniond& state, const Eigen::Vector3d& step) {
        return (so3_exp(step) * state).normalized();
      },
      options.max_iterations, options.step_tolerance);
  result.cur_from_prev.rotation = rotation;
  result.initial_cost = summary.initial_cost;
  result.final_cost = summary.final_cost;
  result.num_iterations = summary.num_iterations;
  return result;
}

}  // namespace stemvo
