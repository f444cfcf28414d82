// SPDX-License-Identifier: MIT
#pragma once

#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "stemvo/geometry/camera.hpp"
#include "stemvo/geometry/rigid3.hpp"

namespace stemvo {

/// Which two-view model a motion came from.
enum class TwoViewModel { kNone, kHomography, kEssential };

/// The point test, paper eq. (8)-(10) in the form of ORB-SLAM2's CheckRT (vo_facts 4a).
struct PointTestOptions {
  double sigma_px = 1.0;              ///< reprojection bound is 2 sigma in either image
  double max_cos_parallax = 0.99998;  ///< points with less parallax cannot vote on the depth sign
  int parallax_rank =
      51;  ///< parallax_deg is that of this rank among good points, the largest first
};

struct PointTestResult {
  /// Reprojected well, and in front of both cameras or without the parallax to tell.
  int num_good = 0;
  int num_with_parallax = 0;    ///< of those, the ones below max_cos_parallax
  double parallax_deg = 0.0;    ///< of the ranked good point (the smallest, of fewer)
  std::vector<char> good_mask;  ///< one per match: 1 where counted in num_good
};

/// Matches in pixels, spans of the same length. Points that are not numbers are bad; without
/// translation every point is.
[[nodiscard]] PointTestResult test_points(const Rigid3& cur_from_prev,
                                          std::span<const Eigen::Vector2d> prev_uv,
                                          std::span<const Eigen::Vector2d> cur_uv,
                                          const Camera& camera,
                                          const PointTestOptions& options = {});

/// A motion picked among the hypotheses of one model.
struct TwoViewMotion {
  TwoViewModel model = TwoViewModel::kNone;
  Rigid3 cur_from_prev;  ///< |translation| == 1
  int num_good = 0;
  double parallax_deg = 0.0;
  /// num_good of the best other hypothesis / num_good; near 1: the choice was a guess.
  double runner_up_ratio = 1.0;
  std::vector<char> good_mask;  ///< one per match
};

/// Best of the 8 hypotheses of H (pixels, cur_from_prev); of those nearly as good, the one that
/// turns least, since a plane leaves two that all its points accept; nullopt when H does not
/// decompose or no point passes. Thresholds are the caller's: see is_decisive().
[[nodiscard]] std::optional<TwoViewMotion> motion_from_homography(
    const Eigen::Matrix3d& homography,
    std::span<const Eigen::Vector2d> prev_uv,
    std::span<const Eigen::Vector2d> cur_uv,
    const Camera& camera,
    const PointTestOptions& options = {});

/// Best of the 4 hypotheses of E (normalised coordinates); nullopt when no point passes.
[[nodiscard]] std::optional<TwoViewMotion> motion_from_essential(
    const Eigen::Matrix3d& essential,
    std::span<const Eigen::Vector2d> prev_uv,
    std::span<const Eigen::Vector2d> cur_uv,
    const Camera& camera,
    const PointTestOptions& options = {});

/// ORB-SLAM2's acceptance (vo_facts 4a): enough good points (absolute and share of num_matches),
/// enough parallax, runner-up far behind (0.75 for H, 0.7 for E).
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
