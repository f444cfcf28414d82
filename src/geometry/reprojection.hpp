// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "stemvo/camera.hpp"

namespace stemvo::internal {

/// Nearer, or behind: no pose sees it; units of length.
inline constexpr double kMinDepth = 1e-6;

/// Where a camera sees a point: projected - measured, px, and its Jacobian, transposed, by (w, v),
/// x_in_camera <- exp(w) x_in_camera + v.
struct ReprojectionTerm {
  Eigen::Vector2d error;
  Eigen::Matrix<double, 6, 2> jacobian;
};

/// `x`: in the camera, beyond kMinDepth.
inline ReprojectionTerm reprojection_term(const Eigen::Vector3d& x,
                                          const Eigen::Vector2d& uv,
                                          const Camera& camera) {
  const double inverse_z = 1.0 / x.z();
  const double u = x.x() * inverse_z;
  const double v = x.y() * inverse_z;
  ReprojectionTerm term;
  term.error =
      Eigen::Vector2d(camera.fx_px * u + camera.cx_px, camera.fy_px * v + camera.cy_px) - uv;
  const Eigen::Vector3d u_by_x = camera.fx_px * inverse_z * Eigen::Vector3d(1.0, 0.0, -u);
  const Eigen::Vector3d v_by_x = camera.fy_px * inverse_z * Eigen::Vector3d(0.0, 1.0, -v);
  term.jacobian << x.cross(u_by_x), x.cross(v_by_x), u_by_x, v_by_x;
  return term;
}

/// Two unit vectors that span the plane at right angles to a unit vector.
inline Eigen::Matrix<double, 3, 2> tangent_basis(const Eigen::Vector3d& direction) {
  Eigen::Matrix<double, 3, 2> basis;
  basis.col(0) = direction.unitOrthogonal();
  basis.col(1) = direction.cross(basis.col(0));
  return basis;
}

}  // namespace stemvo::internal
