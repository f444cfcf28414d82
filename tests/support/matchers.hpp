// SPDX-License-Identifier: MIT
#pragma once

#include "stemvo/camera.hpp"
#include "stemvo/rigid3.hpp"
#include "support/test.hpp"

namespace stemvo::testing {

/// Angle between two rotations, exact near zero.
inline double rotation_error_rad(const Rigid3& a, const Rigid3& b) {
  return Rigid3(a.rotation * b.rotation.conjugate(), Eigen::Vector3d::Zero()).angle_rad();
}

/// Angle between two directions, exact near zero; NaN where one has no length.
inline double direction_error_rad(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  const Eigen::Vector3d u = a / a.norm();
  const Eigen::Vector3d v = b / b.norm();
  return 2.0 * std::atan2((u - v).norm(), (u + v).norm());
}

/// fx, fy, cx, cy, width, height.
inline std::vector<double> numbers_of(const Camera& c) {
  return {c.fx_px, c.fy_px, c.cx_px, c.cy_px, 1.0 * c.width_px, 1.0 * c.height_px};
}

/// KITTI's rows of a camera that is turned by 90 degrees about y and goes 2 m a frame along world
/// x.
inline std::string pose_lines(int count) {
  std::string text;
  for (int i = 0; i < count; ++i) {
    text += fmt::format("0 0 1 {} 0 1 0 0 -1 0 0 3\n", 2 * i);
  }
  return text;
}

/// Largest difference of an entry; NaN fails. For vectors and matrices of the same size.
MATCHER_P2(IsNear, expected, tolerance, "is near the expected matrix") {
  const double error = (arg - expected).cwiseAbs().maxCoeff();
  *result_listener << "largest difference " << error << "\n" << arg;
  return (arg - expected).allFinite() && error <= tolerance;
}

/// Rotation within tolerance rad and translation within tolerance; NaN fails.
MATCHER_P2(IsNearMotion, expected, tolerance, "is near the expected motion") {
  const double angle = rotation_error_rad(arg, expected);
  const double distance = (arg.translation - expected.translation).norm();
  *result_listener << "rotation differs by " << angle << " rad, translation by " << distance;
  return angle <= tolerance && distance <= tolerance;
}

}  // namespace stemvo::testing
