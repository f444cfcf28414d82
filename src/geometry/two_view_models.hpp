// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

#include "geometry/pixel_pairs.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// Chi-square 95 % bound of one degree of freedom, in units of sigma^2.
inline constexpr double kFundamentalChi2 = 3.841;

/// Score of one two-view model over all matches, paper eq. (5) and (6).
struct ModelScore {
  double score = 0.0;
  int num_inliers = 0;            ///< matches within the bound in both directions
  std::vector<char> inlier_mask;  ///< one per match
};

/// S_H of x_cur ~ H x_prev (H = cur_from_prev, pixels). A singular H scores 0.
[[nodiscard]] ModelScore score_homography(const Eigen::Matrix3d& homography,
                                          const PixelPairs& pairs,
                                          double sigma_px);

/// S_F of x_cur^T F x_prev = 0 (pixels); distances of each point to its epipolar line.
[[nodiscard]] ModelScore score_fundamental(const Eigen::Matrix3d& fundamental,
                                           const PixelPairs& pairs,
                                           double sigma_px);

/// R_H = S_H / (S_H + S_F), paper eq. (7); 0 when both scores are 0.
[[nodiscard]] double homography_ratio(double homography_score, double fundamental_score);

/// The 8 hypotheses of H (pixels, cur_from_prev) by Faugeras & Lustman, lambda K^-1 H K = R + T
/// n^T; |translation| == 1. Empty when two singular values of K^-1 H K coincide (ratio < 1.00001:
/// pure rotation or degenerate), or H has rank 1.
[[nodiscard]] std::vector<Rigid3> decompose_homography(const Eigen::Matrix3d& homography,
                                                       const Camera& camera);

/// The 4 hypotheses {U W V^T, U W^T V^T} x {+u3, -u3}; |translation| == 1.
/// E may have any scale.
[[nodiscard]] std::array<Rigid3, 4> decompose_essential(const Eigen::Matrix3d& essential);

/// E = K^T F K.
[[nodiscard]] inline Eigen::Matrix3d essential_from_fundamental(const Eigen::Matrix3d& fundamental,
                                                                const Camera& camera) {
  const Eigen::Matrix3d k = camera.matrix();
  return k.transpose() * fundamental * k;
}

/// F = K^-T E K^-1.
[[nodiscard]] inline Eigen::Matrix3d fundamental_from_essential(const Eigen::Matrix3d& essential,
                                                                const Camera& camera) {
  const Eigen::Matrix3d k_inverse = camera.matrix().inverse();
  return k_inverse.transpose() * essential * k_inverse;
}

/// E = [t]x R.
[[nodiscard]] inline Eigen::Matrix3d essential_from_motion(const Rigid3& cur_from_prev) {
  return skew(cur_from_prev.translation) * cur_from_prev.rotation_matrix();
}

}  // namespace stemvo
