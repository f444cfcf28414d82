// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Core>

#include "stemvo/rigid3.hpp"

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
[[nodiscard]] TriangulatedPoint triangulate(const Rigid3& cur_from_prev,
                                            const Eigen::Vector2d& prev_xy,
                                            const Eigen::Vector2d& cur_xy);

}  // namespace stemvo
