// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace stemvo {

using Matrix34d = Eigen::Matrix<double, 3, 4>;

/// Rigid motion `b_from_a`: x_in_b = rotation * x_in_a + translation. The quaternion is kept at
/// unit length by every operation, so long chains stay orthonormal.
struct Rigid3 {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Rigid3() = default;
  Rigid3(const Eigen::Quaterniond& rotation_in, const Eigen::Vector3d& translation_in)
      : rotation(rotation_in.normalized()), translation(translation_in) {}

  /// From [R | t]; R is replaced by the nearest rotation (pose files are orthonormal to 1e-7 only).
  /// An R that is not finite gives a rotation of NaN.
  [[nodiscard]] static Rigid3 from_matrix(const Matrix34d& matrix);
  [[nodiscard]] static Rigid3 from_matrix(const Eigen::Matrix3d& rotation,
                                          const Eigen::Vector3d& translation);

  [[nodiscard]] Eigen::Matrix3d rotation_matrix() const { return rotation.toRotationMatrix(); }
  [[nodiscard]] Matrix34d matrix() const;
  [[nodiscard]] Rigid3 inverse() const;
  /// Angle of the rotation, in [0, pi] rad; exact for small angles.
  [[nodiscard]] double angle_rad() const;
};

/// c_from_a = c_from_b * b_from_a.
[[nodiscard]] Rigid3 operator*(const Rigid3& c_from_b, const Rigid3& b_from_a);
/// x_in_b = b_from_a * x_in_a.
[[nodiscard]] Eigen::Vector3d operator*(const Rigid3& b_from_a, const Eigen::Vector3d& x_in_a);

/// Rigid motion and change of lengths `b_from_a`: x_in_b = scale * (rotation * x_in_a) +
/// translation. One of `a` is `scale` of `b`.
struct Similarity3 {
  double scale = 1.0;
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Similarity3() = default;
  Similarity3(double scale_in,
              const Eigen::Quaterniond& rotation_in,
              const Eigen::Vector3d& translation_in)
      : scale(scale_in), rotation(rotation_in.normalized()), translation(translation_in) {}
  explicit Similarity3(const Rigid3& rigid)
      : rotation(rigid.rotation), translation(rigid.translation) {}

  [[nodiscard]] Similarity3 inverse() const;
};
[[nodiscard]] Similarity3 operator*(const Similarity3& c_from_b, const Similarity3& b_from_a);
[[nodiscard]] Eigen::Vector3d operator*(const Similarity3& b_from_a, const Eigen::Vector3d& x_in_a);
/// A camera's pose among the points that the similarity moves: lengths are b's.
[[nodiscard]] Rigid3 operator*(const Similarity3& b_from_a, const Rigid3& a_from_camera);

/// Cross-product matrix: skew(a) * b == a x b.
[[nodiscard]] Eigen::Matrix3d skew(const Eigen::Vector3d& a);
/// Rotation of |w| rad about w (Rodrigues); so3_log is its inverse, |result| <= pi.
[[nodiscard]] Eigen::Quaterniond so3_exp(const Eigen::Vector3d& rotation_vector_rad);
[[nodiscard]] Eigen::Vector3d so3_log(const Eigen::Quaterniond& rotation);

}  // namespace stemvo
