// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "geometry/two_view_models.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo::internal {

/// Two image points moved by the least amount that makes their rays meet. NaN where that is
/// undefined (no baseline, both points at the epipoles).
struct CorrectedMatch {
  Eigen::Vector2d prev;
  Eigen::Vector2d cur;
};

/// Lindstrom, "Triangulation Made Easy" (CVPR 2010), the variant with two steps: the reprojection
/// error is the least possible one, in a fixed number of operations. `fundamental` and the points
/// may be in any units.
inline CorrectedMatch correct_match(const Eigen::Matrix3d& fundamental,
                                    const Eigen::Vector2d& prev,
                                    const Eigen::Vector2d& cur) {
  const Eigen::Matrix2d top = fundamental.topLeftCorner<2, 2>();
  const Eigen::Vector3d line_in_cur = fundamental * prev.homogeneous();
  Eigen::Vector2d normal_cur = line_in_cur.head<2>();
  Eigen::Vector2d normal_prev =
      top.transpose() * cur + fundamental.bottomLeftCorner<1, 2>().transpose();
  const double a = normal_cur.dot(top * normal_prev);
  const double b = 0.5 * (normal_cur.squaredNorm() + normal_prev.squaredNorm());
  const double c = cur.homogeneous().dot(line_in_cur);
  const double d = std::sqrt(b * b - a * c);
  const double first = c / (b + d);
  const Eigen::Vector2d step_cur = first * normal_cur;
  const Eigen::Vector2d step_prev = first * normal_prev;
  normal_cur -= top * step_prev;
  normal_prev -= top.transpose() * step_cur;
  const double second = first * 2.0 * d / (normal_cur.squaredNorm() + normal_prev.squaredNorm());
  return {prev - second * normal_prev, cur - second * normal_cur};
}

/// Where two rays meet: X_cur = depth_cur * (cur, 1), X_prev = depth_prev * (prev, 1).
struct RayMeeting {
  double depth_prev = 0.0;
  double depth_cur = 0.0;
  double cos_rays = 1.0;  ///< between the viewing rays
  bool finite = false;    ///< false: parallel within 1e-8 rad, depths are meaningless
};

/// Depths from the closest points of the two lines; exact where they meet. Normalised points.
inline RayMeeting meet_rays(const Eigen::Matrix3d& rotation,
                            const Eigen::Vector3d& translation,
                            const Eigen::Vector2d& prev,
                            const Eigen::Vector2d& cur) {
  const Eigen::Vector3d ray_prev = rotation * prev.homogeneous();
  const Eigen::Vector3d ray_cur = cur.homogeneous();
  const Eigen::Vector3d normal = ray_prev.cross(ray_cur);
  const double squared_norms = ray_prev.squaredNorm() * ray_cur.squaredNorm();
  const double squared_normal = normal.squaredNorm();
  RayMeeting result;
  result.cos_rays = ray_prev.dot(ray_cur) / std::sqrt(squared_norms);
  result.finite = squared_normal > 1e-16 * squared_norms;
  if (result.finite) {
    // depth_prev * ray_prev + translation = depth_cur * ray_cur, crossed with either ray.
    result.depth_prev = ray_cur.cross(translation).dot(normal) / squared_normal;
    result.depth_cur = ray_prev.cross(translation).dot(normal) / squared_normal;
  }
  return result;
}

}  // namespace stemvo::internal

namespace stemvo {

/// A point seen by two cameras, in coordinates of the previous one.
struct TriangulatedPoint {
  Eigen::Vector3d in_prev = Eigen::Vector3d::Zero();
  double cos_parallax = 1.0;  ///< cosine of the angle between the two viewing rays
  bool finite = false;        ///< false: rays parallel within 1e-8 rad; the rest means nothing
};

/// Least-squares triangulation of normalised image points (plane z = 1): the least correction that
/// makes the rays meet (Lindstrom, CVPR 2010), then their meeting point, which may lie behind the
/// cameras. Scale is that of the motion's translation; without translation nothing is finite.
[[nodiscard]] inline TriangulatedPoint triangulate(const Rigid3& cur_from_prev,
                                                   const Eigen::Vector2d& prev_xy,
                                                   const Eigen::Vector2d& cur_xy) {
  const internal::CorrectedMatch match =
      internal::correct_match(essential_from_motion(cur_from_prev), prev_xy, cur_xy);
  const internal::RayMeeting meeting = internal::meet_rays(
      cur_from_prev.rotation_matrix(), cur_from_prev.translation, match.prev, match.cur);
  return {meeting.depth_prev * match.prev.homogeneous(), meeting.cos_rays, meeting.finite};
}

}  // namespace stemvo
