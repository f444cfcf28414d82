// SPDX-License-Identifier: MIT
#pragma once

#include <vector>

#include <Eigen/Core>

#include "geometry/pixel_pairs.hpp"

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

}  // namespace stemvo
