// SPDX-License-Identifier: MIT
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

namespace stemvo {

/// Chi-square 95 % bounds (2 and 1 degrees of freedom) and the paper's Gamma, in units of sigma^2.
inline constexpr double kHomographyChi2 = 5.991;
inline constexpr double kFundamentalChi2 = 3.841;
inline constexpr double kScoreGamma = 5.991;

/// Score of one two-view model over all matches, paper eq. (5) and (6).
struct ModelScore {
  double score = 0.0;
  int num_inliers = 0;            ///< matches within the bound in both directions
  std::vector<char> inlier_mask;  ///< one per match
};

/// S_H of x_cur ~ H x_prev (H = cur_from_prev, pixels). A singular H scores 0.
/// Both spans hold pixels and have the same length.
[[nodiscard]] ModelScore score_homography(const Eigen::Matrix3d& homography,
                                          std::span<const Eigen::Vector2d> prev_uv,
                                          std::span<const Eigen::Vector2d> cur_uv,
                                          double sigma_px);

/// S_F of x_cur^T F x_prev = 0 (pixels); distances of each point to its epipolar line.
[[nodiscard]] ModelScore score_fundamental(const Eigen::Matrix3d& fundamental,
                                           std::span<const Eigen::Vector2d> prev_uv,
                                           std::span<const Eigen::Vector2d> cur_uv,
                                           double sigma_px);

/// R_H = S_H / (S_H + S_F), paper eq. (7); 0 when both scores are 0.
[[nodiscard]] double homography_ratio(double homography_score, double fundamental_score);

}  // namespace stemvo
