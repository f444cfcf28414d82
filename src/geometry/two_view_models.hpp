// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "geometry/pixel_pairs.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/frame_result.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// Chi-square 95 % bound of one degree of freedom, in units of sigma^2.
inline constexpr double kFundamentalChi2 = 3.841;

/// Score of one two-view model over all matches, paper eq. (5) and (6).
struct ModelScore {
  double score = 0.0;
  std::vector<char> inlier_mask;  ///< one per match: within the bound in both directions
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

/// The point test, paper eq. (8)-(10) in the form of ORB-SLAM2's CheckRT.
struct PointTestOptions {
  double sigma_px = 1.0;  ///< reprojection bound is 2 sigma in either image
  /// parallax_deg is that of this rank among good points, the largest first.
  int parallax_rank = 51;
};

struct PointTest {
  /// Reprojected well, and in front of both cameras or without the parallax to tell.
  int num_good = 0;
  double parallax_deg = 0.0;    ///< of the ranked good point (the smallest, of fewer)
  std::vector<char> good_mask;  ///< one per match: 1 where counted in num_good
};

/// Points that are not numbers are bad; without translation every point is.
[[nodiscard]] PointTest test_points(const Rigid3& cur_from_prev,
                                    const PixelPairs& pairs,
                                    const Camera& camera,
                                    const PointTestOptions& options = {});

/// A motion picked among the hypotheses of one model.
struct TwoViewMotion {
  TwoViewModel model = TwoViewModel::kNone;
  Rigid3 cur_from_prev;  ///< |translation| is 1
  PointTest test;
  /// num_good of the best other hypothesis / num_good; near 1: the choice was a guess.
  double runner_up_ratio = 1.0;
};

/// The hypothesis with the most good points. A plane leaves two that all its points accept: of
/// those of a homography that are nearly as good, the one that turns least. nullopt when no point
/// passes. Thresholds are the caller's: see is_decisive().
[[nodiscard]] std::optional<TwoViewMotion> best_motion(TwoViewModel model,
                                                       std::span<const Rigid3> hypotheses,
                                                       const PixelPairs& pairs,
                                                       const Camera& camera,
                                                       const PointTestOptions& options = {});

/// ORB-SLAM2's acceptance: enough good points (absolute and share of num_matches), enough parallax,
/// runner-up far behind (0.75 for H, 0.7 for E).
struct AcceptanceOptions {
  int min_good = 50;
  double min_good_share = 0.9;
  double min_parallax_deg = 1.0;
  double max_runner_up_homography = 0.75;
  double max_runner_up_essential = 0.7;
};
[[nodiscard]] bool is_decisive(const TwoViewMotion& motion,
                               int num_matches,
                               const AcceptanceOptions& options = {});

}  // namespace stemvo
