// SPDX-License-Identifier: MIT
#include "odometry/reprojection_cost.hpp"

#include <cmath>

#include "stemvo/geometry/rigid3.hpp"

namespace stemvo {
namespace {

/// exp(w) and the left Jacobian J of SO(3), exp(w + d) = exp(J d) exp(w) for small d (Solà,
/// Deray, Atchuthan: A micro Lie theory, 2018, eqs. 134 and 145).
struct RotationChange {
  explicit RotationChange(const Eigen::Vector3d& w) {
    const double angle_sq = w.squaredNorm();
    const double angle = std::sqrt(angle_sq);
    const bool is_small = angle_sq < 1e-8;  // the next terms of the series are below 1e-10
    const double a = is_small ? 1.0 - angle_sq / 6.0 : std::sin(angle) / angle;
    const double b = is_small ? 0.5 - angle_sq / 24.0 : (1.0 - std::cos(angle)) / angle_sq;
    const double c = is_small ? 1.0 / 6.0 - angle_sq / 120.0 : (1.0 - a) / angle_sq;
    const Eigen::Matrix3d hat = skew(w);
    const Eigen::Matrix3d hat_sq = hat * hat;
    rotation = Eigen::Matrix3d::Identity() + a * hat + b * hat_sq;
    jacobian = Eigen::Matrix3d::Identity() + b * hat + c * hat_sq;
  }
  Eigen::Matrix3d rotation;
  Eigen::Matrix3d jacobian;
};

}  // namespace

bool ReprojectionCost::Evaluate(const double* const* parameters,
                                double* residuals,
                                double** jacobians) const {
  const Eigen::Map<const Eigen::Vector3d> w(parameters[0]);
  const Eigen::Map<const Eigen::Vector3d> t(parameters[0] + 3);
  const Eigen::Map<const Eigen::Vector3d> point(parameters[1]);
  const RotationChange change(w);
  const Eigen::Vector3d turned = change.rotation * (rotation_ * point);
  const Eigen::Vector3d x = turned + t;
  if (!(x.z() > kMinDepth)) {
    return false;
  }
  const double inverse_z = 1.0 / x.z();
  const double u = x.x() * inverse_z;
  const double v = x.y() * inverse_z;
  residuals[0] = camera_.fx_px * u + camera_.cx_px - uv_.x();
  residuals[1] = camera_.fy_px * v + camera_.cy_px - uv_.y();
  if (jacobians == nullptr) {
    return true;
  }
  Eigen::Matrix<double, 2, 3> by_x;
  by_x << camera_.fx_px * inverse_z, 0.0, -camera_.fx_px * u * inverse_z,  //
      0.0, camera_.fy_px * inverse_z, -camera_.fy_px * v * inverse_z;
  if (jacobians[0] != nullptr) {
    Eigen::Map<Eigen::Matrix<double, 2, 6, Eigen::RowMajor>> by_pose(jacobians[0]);
    by_pose.leftCols<3>() = -by_x * skew(turned) * change.jacobian;
    by_pose.rightCols<3>() = by_x;
  }
  if (jacobians[1] != nullptr) {
    Eigen::Map<Eigen::Matrix<double, 2, 3, Eigen::RowMajor>> by_point(jacobians[1]);
    by_point = by_x * change.rotation * rotation_;
  }
  return true;
}

}  // namespace stemvo
