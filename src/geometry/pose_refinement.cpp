// SPDX-License-Identifier: MIT
#include "geometry/pose_refinement.hpp"

#include <cmath>
#include <cstddef>
#include <limits>

#include "geometry/minimize.hpp"
#include "geometry/residuals.hpp"

namespace stemvo {
namespace {

/// A shorter step ends the minimization: rad, and units of length.
constexpr double kMotionTolerance = 1e-10;
constexpr double kPoseTolerance = 1e-7;
/// Error of a point behind the camera, so that no step gains by pushing points behind it.
constexpr double kBehindErrorPx = 1e3;

struct RayPair {
  Eigen::Vector3d prev;  ///< viewing rays, z = 1
  Eigen::Vector3d cur;
};

std::vector<RayPair> rays_of(const PixelPairs& pairs, const Camera& camera) {
  std::vector<RayPair> rays;
  rays.reserve(pairs.size());
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    rays.push_back({camera.normalize(pairs.prev_uv[i]).homogeneous(),
                    camera.normalize(pairs.cur_uv[i]).homogeneous()});
  }
  return rays;
}

using Vector5d = Eigen::Matrix<double, 5, 1>;

QuadraticModel<5> linearize_motion(const Rigid3& motion,
                                   const std::vector<RayPair>& rays,
                                   const Camera& camera,
                                   double loss_scale_px) {
  const Eigen::Matrix3d rotation = motion.rotation_matrix();
  const Eigen::Matrix<double, 2, 3> to_tangent =
      internal::tangent_basis(motion.translation).transpose();
  const Eigen::Vector3d squared_inverse_focal(1.0 / (camera.fx_px * camera.fx_px),
                                              1.0 / (camera.fy_px * camera.fy_px), 0.0);
  QuadraticModel<5> equations;
  CauchyLoss loss(loss_scale_px);
  for (const RayPair& pair : rays) {
    const internal::SampsonTerm term = internal::sampson_term(
        rotation, motion.translation, squared_inverse_focal, pair.prev, pair.cur);
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

Rigid3 move_motion(const Rigid3& motion, const Vector5d& step) {
  const Eigen::Vector3d tangent = internal::tangent_basis(motion.translation) * step.tail<2>();
  // The rotation that carries the direction along the tangent keeps it on the sphere.
  const Eigen::Vector3d moved = so3_exp(motion.translation.cross(tangent)) * motion.translation;
  return {so3_exp(step.head<3>()) * motion.rotation, moved.normalized()};
}

/// Residual f (cur - R prev) of unit rays: the angle in px, without the singularity of a
/// projection. Its Jacobian for R <- exp(w) R is f [R prev]x.
QuadraticModel<3> linearize_rotation(const Eigen::Quaterniond& rotation,
                                     const std::vector<RayPair>& unit_rays,
                                     double focal_px,
                                     double loss_scale_px) {
  const Eigen::Matrix3d r = rotation.toRotationMatrix();
  const double squared_focal = focal_px * focal_px;
  QuadraticModel<3> equations;
  CauchyLoss loss(loss_scale_px);
  for (const RayPair& pair : unit_rays) {
    const Eigen::Vector3d y = r * pair.prev;
    const double weight = squared_focal * loss.add(squared_focal * (pair.cur - y).squaredNorm());
    equations.hessian += weight * (Eigen::Matrix3d::Identity() - y * y.transpose());
    equations.gradient += weight * pair.cur.cross(y);
  }
  equations.cost = loss.sum();
  return equations;
}

QuadraticModel<6> linearize_pose(const Rigid3& camera_from_world,
                                 std::span<const Eigen::Vector3d> points,
                                 std::span<const Eigen::Vector2d> uv,
                                 const Camera& camera,
                                 double loss_scale_px) {
  const Eigen::Matrix3d rotation = camera_from_world.rotation_matrix();
  QuadraticModel<6> equations;
  CauchyLoss loss(loss_scale_px);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d x = rotation * points[i] + camera_from_world.translation;
    if (!(x.z() > internal::kMinDepth)) {
      loss.add(kBehindErrorPx * kBehindErrorPx);
      continue;
    }
    const internal::ReprojectionTerm at = internal::reprojection_term(x, uv[i], camera);
    const Eigen::Matrix<double, 6, 2> weighted = loss.add(at.error.squaredNorm()) * at.jacobian;
    equations.hessian.noalias() += weighted * at.jacobian.transpose();
    equations.gradient.noalias() += weighted * at.error;
  }
  equations.cost = loss.sum();
  return equations;
}

constexpr std::size_t kMinPoints = 4;

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
    loss.add(kBehindErrorPx * kBehindErrorPx);
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

RefinedMotion refine_relative_pose(const Rigid3& cur_from_prev,
                                   const PixelPairs& pairs,
                                   const Camera& camera,
                                   const RefinementOptions& options) {
  const std::vector<RayPair> rays = rays_of(pairs, camera);
  const double length = cur_from_prev.translation.norm();
  if (!(length > 0.0) || rays.size() < 5) {
    return {cur_from_prev};
  }
  RefinedMotion result{Rigid3(cur_from_prev.rotation, cur_from_prev.translation / length)};
  result.cost = minimize<5>(
      result.cur_from_prev,
      [&](const Rigid3& state) {
        return linearize_motion(state, rays, camera, options.loss_scale_px);
      },
      move_motion, options.max_iterations, kMotionTolerance);
  return result;
}

Eigen::Quaterniond refine_rotation(const Eigen::Quaterniond& rotation,
                                   const PixelPairs& pairs,
                                   const Camera& camera,
                                   const RefinementOptions& options) {
  std::vector<RayPair> rays = rays_of(pairs, camera);
  if (rays.size() < 2) {
    return rotation;
  }
  for (RayPair& pair : rays) {
    pair.prev.normalize();
    pair.cur.normalize();
  }
  Eigen::Quaterniond refined = rotation.normalized();
  minimize<3>(
      refined,
      [&](const Eigen::Quaterniond& state) {
        return linearize_rotation(state, rays, camera.mean_focal_px(), options.loss_scale_px);
      },
      [](const Eigen::Quaterniond& state, const Eigen::Vector3d& step) {
        return (so3_exp(step) * state).normalized();
      },
      options.max_iterations, kMotionTolerance);
  return refined;
}

Rigid3 refine_absolute_pose(const Rigid3& camera_from_world,
                            std::span<const Eigen::Vector3d> points_in_world,
                            std::span<const Eigen::Vector2d> uv,
                            const Camera& camera,
                            const RefinementOptions& options) {
  Rigid3 refined = camera_from_world;
  if (uv.size() >= 4) {
    minimize<6>(
        refined,
        [&](const Rigid3& pose) {
          return linearize_pose(pose, points_in_world, uv, camera, options.loss_scale_px);
        },
        [](const Rigid3& pose, const Eigen::Matrix<double, 6, 1>& step) {
          return Rigid3(so3_exp(step.head<3>()), step.tail<3>()) * pose;
        },
        options.max_iterations, kPoseTolerance);
  }
  return refined;
}

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
  minimize<7>(refined.a_from_b, linearize, move_similarity, options.max_iterations, kPoseTolerance);
  refined.covariance = linearize(refined.a_from_b).hessian.ldlt().solve(Matrix7d::Identity());
  return refined;
}

}  // namespace stemvo
