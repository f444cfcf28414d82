// SPDX-License-Identifier: MIT
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "geometry/pixel_pairs.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

// How sure a refined pose is, from the residuals that are left: nobody has to know the noise of the
// tracks. Order of the six: x y z, then rotation about x y z, in the camera's axes.

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// How a small motion (v, w) in the axes of a is seen in those of b.
[[nodiscard]] Matrix6d adjoint(const Rigid3& b_from_a);

/// How far each point alone moves the pose that refine_absolute_pose() finds: it is the distance
/// between the poses with and without the point, to first order. So a point that the pose obeys has
/// the residual that it had without. x_in_camera <- exp(w) x_in_camera + v.
struct PoseInfluences {
  std::vector<Vector6d> of_point;          ///< zero: behind the camera
  Matrix6d covariance = Matrix6d::Zero();  ///< for weighted residuals of 1 px; finite

  /// Covariance of the pose where the errors of the points are independent.
  [[nodiscard]] Matrix6d squared_sum() const {
    Matrix6d sum = Matrix6d::Zero();
    for (const Vector6d& influence : of_point) {
      sum.noalias() += influence * influence.transpose();
    }
    return sum;
  }
};
/// `loss_scale_px`: of the refinement (Cauchy); infinity: every residual has weight 1.
[[nodiscard]] PoseInfluences pose_influences(const Rigid3& camera_from_world,
                                             std::span<const Eigen::Vector3d> points_in_world,
                                             std::span<const Eigen::Vector2d> uv,
                                             const Camera& camera,
                                             double loss_scale_px);

/// Covariance of a motion that refine_relative_pose() found (|translation| is 1): the true
/// cur_from_prev^-1 is cur_from_prev^-1 times an error in the current camera's axes. The length
/// counts as known.
[[nodiscard]] Matrix6d relative_pose_covariance(const Rigid3& cur_from_prev,
                                                const PixelPairs& pairs,
                                                const Camera& camera,
                                                double loss_scale_px);

}  // namespace stemvo
