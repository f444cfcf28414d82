// SPDX-License-Identifier: MIT
#include "stemvo/rigid3.hpp"

#include <cmath>
#include <limits>

#include <Eigen/LU>
#include <Eigen/SVD>

namespace stemvo {

Rigid3 Rigid3::from_matrix(const Matrix34d& matrix) {
  return from_matrix(matrix.leftCols<3>(), matrix.col(3));
}

Rigid3 Rigid3::from_matrix(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation) {
  Rigid3 result;
  result.translation = translation;
  if (!rotation.allFinite()) {
    // The SVD of NaN is anything; a broken matrix must stay visible to whoever checks the result.
    result.rotation.coeffs().setConstant(std::numeric_limits<double>::quiet_NaN());
    return result;
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(rotation, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d u = svd.matrixU();
  if ((u * svd.matrixV().transpose()).determinant() < 0.0) {
    u.col(2) *= -1.0;
  }
  result.rotation = Eigen::Quaterniond(Eigen::Matrix3d(u * svd.matrixV().transpose())).normalized();
  return result;
}

Matrix34d Rigid3::matrix() const {
  Matrix34d result;
  result << rotation_matrix(), translation;
  return result;
}

Rigid3 Rigid3::inverse() const {
  const Eigen::Quaterniond inverse_rotation = rotation.conjugate();
  return {inverse_rotation, -(inverse_rotation * translation)};
}

double Rigid3::angle_rad() const {
  // acos of the trace would lose half of the digits near zero.
  return 2.0 * std::atan2(rotation.vec().norm(), std::abs(rotation.w()));
}

Rigid3 operator*(const Rigid3& c_from_b, const Rigid3& b_from_a) {
  return {c_from_b.rotation * b_from_a.rotation,
          c_from_b.rotation * b_from_a.translation + c_from_b.translation};
}

Eigen::Vector3d operator*(const Rigid3& b_from_a, const Eigen::Vector3d& x_in_a) {
  return b_from_a.rotation * x_in_a + b_from_a.translation;
}

Similarity3 Similarity3::inverse() const {
  const Eigen::Quaterniond inverse_rotation = rotation.conjugate();
  return {1.0 / scale, inverse_rotation, -(inverse_rotation * translation) / scale};
}

Similarity3 operator*(const Similarity3& c_from_b, const Similarity3& b_from_a) {
  return {c_from_b.scale * b_from_a.scale, c_from_b.rotation * b_from_a.rotation,
          c_from_b * b_from_a.translation};
}

Eigen::Vector3d operator*(const Similarity3& b_from_a, const Eigen::Vector3d& x_in_a) {
  return b_from_a.scale * (b_from_a.rotation * x_in_a) + b_from_a.translation;
}

Rigid3 operator*(const Similarity3& b_from_a, const Rigid3& a_from_camera) {
  return {b_from_a.rotation * a_from_camera.rotation, b_from_a * a_from_camera.translation};
}

Eigen::Matrix3d skew(const Eigen::Vector3d& a) {
  Eigen::Matrix3d result;
  result << 0.0, -a.z(), a.y(), a.z(), 0.0, -a.x(), -a.y(), a.x(), 0.0;
  return result;
}

Eigen::Quaterniond so3_exp(const Eigen::Vector3d& rotation_vector_rad) {
  const double angle = rotation_vector_rad.norm();
  // Below 1e-4 the next term of sin(a/2)/a is smaller than the rounding error.
  const double sinc = angle < 1e-4 ? 0.5 - angle * angle / 48.0 : std::sin(0.5 * angle) / angle;
  Eigen::Quaterniond result;
  result.w() = std::cos(0.5 * angle);
  result.vec() = sinc * rotation_vector_rad;
  return result.normalized();
}

Eigen::Vector3d so3_log(const Eigen::Quaterniond& rotation) {
  // q and -q are the same rotation; the one with w >= 0 turns by at most pi.
  const double sign = rotation.w() < 0.0 ? -1.0 : 1.0;
  const double sine = rotation.vec().norm();
  const double cosine = sign * rotation.w();
  const double scale = sine < 1e-10 ? 2.0 / cosine : 2.0 * std::atan2(sine, cosine) / sine;
  return sign * scale * rotation.vec();
}

}  // namespace stemvo
