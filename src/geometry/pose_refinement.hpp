// SPDX-License-Identifier: MIT
#pragma once

#include <span>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "geometry/pixel_pairs.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

// Robust refinement (Cauchy loss, Levenberg-Marquardt, analytic derivatives) from a start that is
// roughly right; with too few pairs the start comes back.

struct RefinementOptions {
  double loss_scale_px = 0.3;  ///< Cauchy scale
  int max_iterations = 20;
};

struct RefinedMotion {
  Rigid3 cur_from_prev;  ///< |translation| == 1
  double cost = 0.0;     ///< sum of the robust loss, px^2; not more than that of the start
};

/// Sampson distance of the pairs over R (3) and the direction of T (2). Unchanged for fewer than 5
/// pairs, and for a motion without translation.
[[nodiscard]] RefinedMotion refine_relative_pose(const Rigid3& cur_from_prev,
                                                 const PixelPairs& pairs,
                                                 const Camera& camera,
                                                 const RefinementOptions& options = {});

/// The rotation alone, cur_from_prev (standing still, pure rotation): angular residuals of x_cur ~
/// K R K^-1 x_prev. Unchanged for fewer than 2 pairs.
[[nodiscard]] Eigen::Quaterniond refine_rotation(const Eigen::Quaterniond& rotation,
                                                 const PixelPairs& pairs,
                                                 const Camera& camera,
                                                 const RefinementOptions& options = {});

/// Reprojection error of points, paired with pixels. Points behind the camera do not pull.
/// Unchanged for fewer than 4 points.
[[nodiscard]] Rigid3 refine_absolute_pose(const Rigid3& camera_from_world,
                                          std::span<const Eigen::Vector3d> points_in_world,
                                          std::span<const Eigen::Vector2d> uv,
                                          const Camera& camera,
                                          const RefinementOptions& options = {});

}  // namespace stemvo
