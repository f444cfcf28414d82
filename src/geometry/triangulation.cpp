// SPDX-License-Identifier: MIT
#include "stemvo/geometry/triangulation.hpp"

#include "optimal_triangulator.hpp"
#include "stemvo/geometry/decomposition.hpp"

namespace stemvo {

TriangulatedPoint triangulate(const Rigid3& cur_from_prev,
                              const Eigen::Vector2d& prev_xy,
                              const Eigen::Vector2d& cur_xy) {
  const internal::CorrectedMatch match =
      internal::correct_match(essential_from_motion(cur_from_prev), prev_xy, cur_xy);
  TriangulatedPoint result;
  if (!match.prev.allFinite() || !match.cur.allFinite()) {
    return result;
  }
  const internal::RayMeeting meeting = internal::meet_rays(
      cur_from_prev.rotation_matrix(), cur_from_prev.translation, match.prev, match.cur);
  result.cos_parallax = meeting.cos_rays;
  result.finite = meeting.finite;
  result.in_prev = meeting.depth_prev * match.prev.homogeneous();
  return result;
}

double depth_in_prev(const Rigid3& cur_from_prev,
                     const Eigen::Vector2d& prev_xy,
                     const Eigen::Vector2d& cur_xy) {
  const Eigen::Matrix3d r = cur_from_prev.rotation_matrix();
  const Eigen::Vector3d& t = cur_from_prev.translation;
  const double x = cur_xy.x();
  return -(t.x() - x * t.z()) / (r.row(0) - x * r.row(2)).dot(prev_xy.homogeneous());
}

}  // namespace stemvo
