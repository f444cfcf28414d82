// SPDX-License-Identifier: MIT
#pragma once

#include <vector>

#include <Eigen/Core>

#include "geometry/pose_refinement.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

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
