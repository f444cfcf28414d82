// SPDX-License-Identifier: MIT
#pragma once

#include <span>
#include <vector>

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

/// A point in one camera's frame, and where the other camera sees it.
struct CrossObservation {
  Eigen::Vector3d point;
  Eigen::Vector2d uv;
};

/// Two cameras that see the same landmarks, each with its own idea, and unit, of where they are.
struct CrossObservations {
  Camera a;
  Camera b;
  std::vector<CrossObservation> of_a;  ///< points of a, seen by b
  std::vector<CrossObservation> of_b;
};

struct RefinedSimilarity {
  Similarity3 a_from_b;
  /// Errors of rotation (rad, axes of a), translation (units of a) and log scale, for
  /// observations of a noise of 1 px.
  Eigen::Matrix<double, 7, 7> covariance = Eigen::Matrix<double, 7, 7>::Zero();
};

/// Reprojection errors in both images over the similarity (Cauchy loss, Levenberg-Marquardt) from a
/// start that is roughly right; fewer than 4 points on a side do not tell it, and it comes back
/// with a covariance of infinity.
[[nodiscard]] RefinedSimilarity refine_similarity(const Similarity3& a_from_b,
                                                  const CrossObservations& seen,
                                                  const RefinementOptions& options = {});

}  // namespace stemvo
