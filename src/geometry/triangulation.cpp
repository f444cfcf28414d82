// SPDX-License-Identifier: MIT
#include "geometry/triangulation.hpp"

#include "geometry/decomposition.hpp"
#include "optimal_triangulator.hpp"

namespace stemvo {

TriangulatedPoint triangulate(const Rigid3& cur_from_prev,
                              const Eigen::Vector2d& prev_xy,
                              const Eigen::Vector2d& cur_xy) {
  const internal::CorrectedMatch match =
      internal::correct_match(essential_from_motion(cur_from_prev), prev_xy, cur_xy);
  const internal::RayMeeting meeting = internal::meet_rays(
      cur_from_prev.rotation_matrix(), cur_from_prev.translation, match.prev, match.cur);
  return {meeting.depth_prev * match.prev.homogeneous(), meeting.cos_rays, meeting.finite};
}

}  // namespace stemvo
