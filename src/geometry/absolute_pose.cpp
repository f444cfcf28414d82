// SPDX-License-Identifier: MIT
#include "stemvo/geometry/absolute_pose.hpp"

#include <cstddef>
#include <optional>

#include "levenberg_marquardt.hpp"
#include "robust_loss.hpp"
#include "stemvo/check.hpp"

namespace stemvo {
namespace {

constexpr std::size_t kMinPoints = 4;
constexpr double kMinDepth = 1e-6;
/// What a point behind the camera costs, so that no step gains by pushing points behind it.
constexpr double kBehindErrorPx = 1e3;

struct Linearization {
  Eigen::Vector2d error;                 ///< projected - measured, px
  Eigen::Matrix<double, 2, 6> jacobian;  ///< by (w, v): x_in_camera <- exp(w) x_in_camera + v
};

std::optional<Linearization> linearize_point(const Eigen::Vector3d& x,
                                             const Eigen::Vector2d& uv,
                                             const Camera& camera) {
  if (!(x.z() > kMinDepth)) {
    return std::nullopt;
  }
  const double inverse_z = 1.0 / x.z();
  Eigen::Matrix<double, 2, 3> projection;
  projection << camera.fx_px * inverse_z, 0.0, -camera.fx_px * x.x() * inverse_z * inverse_z,  //
      0.0, camera.fy_px * inverse_z, -camera.fy_px * x.y() * inverse_z * inverse_z;
  Linearization result;
  result.error = camera.project(x) - uv;
  result.jacobian.leftCols<3>() = -projection * skew(x);
  result.jacobian.rightCols<3>() = projection;
  return result;
}

internal::NormalEquations<6> linearize(const Rigid3& camera_from_world,
                                       const std::vector<Eigen::Vector3d>& points,
                                       const std::vector<Eigen::Vector2d>& uv,
                                       const Camera& camera,
                                       double loss_scale_px) {
  const Eigen::Matrix3d rotation = camera_from_world.rotation_matrix();
  internal::NormalEquations<6> equations;
  internal::CauchyLoss loss(loss_scale_px);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d x = rotation * points[i] + camera_from_world.translation;
    const std::optional<Linearization> point = linearize_point(x, uv[i], camera);
    if (!point.has_value()) {
      loss.add(kBehindErrorPx * kBehindErrorPx);
      continue;
    }
    const double weight = loss.add(point->error.squaredNorm());
    equations.hessian += weight * point->jacobian.transpose() * point->jacobian;
    equations.gradient += weight * point->jacobian.transpose() * point->error;
  }
  equations.cost = loss.sum();
  return equations;
}

Rigid3 retract(const Rigid3& camera_from_world, const Eigen::Matrix<double, 6, 1>& step) {
  const Rigid3 moved(so3_exp(step.head<3>()), step.tail<3>());
  return moved * camera_from_world;
}

void mark_inliers(std::span<const Eigen::Vector3d> points,
                  std::span<const Eigen::Vector2d> uv,
                  const Camera& camera,
                  double bound_px,
                  AbsolutePose& result) {
  result.inlier_mask.assign(points.size(), 0);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d x = result.camera_from_world * points[i];
    if (x.z() > kMinDepth && (camera.project(x) - uv[i]).norm() <= bound_px) {
      result.inlier_mask[i] = 1;
      ++result.num_inliers;
    }
  }
}

}  // namespace

AbsolutePose refine_absolute_pose(const Rigid3& camera_from_world,
                                  std::span<const Eigen::Vector3d> points_in_world,
                                  std::span<const Eigen::Vector2d> uv,
                                  const Camera& camera,
                                  const AbsolutePoseOptions& options) {
  STEMVO_CHECK(points_in_world.size() == uv.size(), "points and pixels are paired");
  AbsolutePose result;
  result.camera_from_world = camera_from_world;
  std::vector<Eigen::Vector3d> finite_points;
  std::vector<Eigen::Vector2d> finite_uv;
  for (std::size_t i = 0; i < uv.size(); ++i) {
    if (points_in_world[i].allFinite() && uv[i].allFinite()) {
      finite_points.push_back(points_in_world[i]);
      finite_uv.push_back(uv[i]);
    }
  }
  if (finite_points.size() >= kMinPoints) {
    const internal::MinimizationSummary summary = internal::minimize<6>(
        result.camera_from_world,
        [&](const Rigid3& pose) {
          return linearize(pose, finite_points, finite_uv, camera, options.loss_scale_px);
        },
        retract, options.max_iterations, options.step_tolerance);
    result.initial_cost = summary.initial_cost;
    result.final_cost = summary.final_cost;
  }
  mark_inliers(points_in_world, uv, camera, options.inlier_bound_px, result);
  return result;
}

}  // namespace stemvo
