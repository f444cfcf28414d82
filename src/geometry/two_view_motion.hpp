// SPDX-License-Identifier: MIT
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "geometry/pixel_pairs.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/frame_result.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

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
