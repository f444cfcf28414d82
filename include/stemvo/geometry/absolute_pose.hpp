// SPDX-License-Identifier: MIT
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "stemvo/geometry/camera.hpp"
#include "stemvo/geometry/rigid3.hpp"

namespace stemvo {

struct AbsolutePoseOptions {
  double loss_scale_px = 0.5;    ///< Cauchy scale on the reprojection error
  double inlier_bound_px = 2.0;  ///< reprojection error of an inlier
  int max_iterations = 20;
  double step_tolerance = 1e-9;  ///< rad and units of length
};

struct AbsolutePose {
  Rigid3 camera_from_world;
  double initial_cost = 0.0;  ///< sum of the robust loss, px^2
  double final_cost = 0.0;    ///< <= initial_cost
  int num_inliers = 0;
  std::vector<char> inlier_mask;  ///< one per point: in front of the camera and within the bound
};

/// Pose from 2D-3D matches: minimises the robust reprojection error (px) by Levenberg-Marquardt
/// from a start that must be roughly right. Points and pixels are paired; points that are not
/// finite or behind the camera do not pull. Fewer than 4 points: the start comes back.
[[nodiscard]] AbsolutePose refine_absolute_pose(const Rigid3& camera_from_world,
                                                std::span<const Eigen::Vector3d> points_in_world,
                                                std::span<const Eigen::Vector2d> uv,
                                                const Camera& camera,
                                                const AbsolutePoseOptions& options = {});

}  // namespace stemvo
