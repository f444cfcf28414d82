// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>

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

/// Signed Sampson distance (px) of one match and its gradient with respect to
/// a left rotation increment (R <- exp(w) R) and to the vector t.
struct SampsonTerm {
  double residual_px = 0.0;
  Eigen::Vector3d by_rotation = Eigen::Vector3d::Zero();
  Eigen::Vector3d by_translation = Eigen::Vector3d::Zero();
};

/// r = c / s with c = x2^T E x1 and s the length of its gradient in the four pixel coordinates,
/// E = [t]x R (Hartley & Zisserman, eq. 11.9). Points are normalised (z = 1);
/// squared_inverse_focal = (1 / fx^2, 1 / fy^2, 0). Where s vanishes (both points at the epipoles)
/// the match says nothing: zero.
inline SampsonTerm sampson_term(const Eigen::Matrix3d& rotation,
                                const Eigen::Vector3d& translation,
                                const Eigen::Vector3d& squared_inverse_focal,
                                const Eigen::Vector3d& x1,
                                const Eigen::Vector3d& x2) {
  const Eigen::Vector3d y = rotation * x1;
  const Eigen::Vector3d line_in_cur = translation.cross(y);          // E x1
  const Eigen::Vector3d w = translation.cross(x2);                   // -R E^T x2
  const Eigen::Vector3d line_in_prev = -(rotation.transpose() * w);  // E^T x2
  const Eigen::Vector3d g_cur = squared_inverse_focal.cwiseProduct(line_in_cur);
  const Eigen::Vector3d g_prev = squared_inverse_focal.cwiseProduct(line_in_prev);
  const double squared_s = g_cur.dot(line_in_cur) + g_prev.dot(line_in_prev);
  SampsonTerm term;
  if (!(squared_s > 0.0)) {
    return term;
  }
  const double inverse_s = 1.0 / std::sqrt(squared_s);
  term.residual_px = x2.dot(line_in_cur) * inverse_s;
  // dr = (dc - (r / s) (g_cur . d(E x1) + g_prev . d(E^T x2))) / s.
  const double ratio = term.residual_px * inverse_s;
  const Eigen::Vector3d h = rotation * g_prev;
  term.by_rotation =
      inverse_s *
      (w.cross(y) - ratio * (translation.dot(y) * g_cur - g_cur.dot(y) * translation + w.cross(h)));
  term.by_translation = inverse_s * (y.cross(x2) - ratio * (y.cross(g_cur) - x2.cross(h)));
  return term;
}

}  // namespace stemvo::internal
