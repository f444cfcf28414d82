// SPDX-License-Identifier: MIT
#pragma once

#include <span>

#include <Eigen/Core>

#include "stemvo/geometry/camera.hpp"
#include "stemvo/geometry/rigid3.hpp"

namespace stemvo {

struct RelativePoseRefinementOptions {
  double loss_scale_px = 0.3;  ///< Cauchy scale on the Sampson distance
  int max_iterations = 20;
  double step_tolerance = 1e-10;  ///< stop when the 5-vector update is shorter (rad)
};

struct RelativePoseRefinement {
  Rigid3 cur_from_prev;       ///< |translation| == 1
  double initial_cost = 0.0;  ///< sum of the robust loss, px^2
  double final_cost = 0.0;    ///< <= initial_cost
  int num_iterations = 0;
};

/// Minimises the robust Sampson distance (px) of all given matches over R (3) and the direction of
/// T (2) by Levenberg-Marquardt with analytic derivatives. Matches that are not numbers are left
/// out. Fewer than 5 matches, no translation or a motion that is not finite: returned unchanged.
[[nodiscard]] RelativePoseRefinement refine_relative_pose(
    const Rigid3& cur_from_prev,
    std::span<const Eigen::Vector2d> prev_uv,
    std::span<const Eigen::Vector2d> cur_uv,
    const Camera& camera,
    const RelativePoseRefinementOptions& options = {});

/// Rotation alone (standing still, pure rotation): robust angular residuals of x_cur ~ K R K^-1
/// x_prev. The result has translation zero; fewer than 2 matches leave the rotation unchanged.
[[nodiscard]] RelativePoseRefinement refine_rotation(
    const Rigid3& cur_from_prev,
    std::span<const Eigen::Vector2d> prev_uv,
    std::span<const Eigen::Vector2d> cur_uv,
    const Camera& camera,
    const RelativePoseRefinementOptions& options = {});

}  // namespace stemvo
