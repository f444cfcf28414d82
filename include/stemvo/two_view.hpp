// SPDX-License-Identifier: MIT
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "stemvo/camera.hpp"
#include "stemvo/error.hpp"
#include "stemvo/frame_result.hpp"
#include "stemvo/options.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// The motion between two images as their matched points tell it.
struct TwoViewResult {
  /// kTracking, or kStationary, kLowParallax, kRotating; kLost: no motion fits the points.
  FrameState state = FrameState::kLost;
  Rigid3 cur_from_prev;  ///< |translation| is 1; 0 where it is stationary, rotating or lost
  TwoViewModel model = TwoViewModel::kNone;  ///< whose motion it is, paper eq. (7)
  double homography_ratio = 0.0;             ///< R_H = S_H / (S_H + S_F), paper eq. (5)-(7)
  double parallax_px = 0.0;                  ///< median flow that no rotation explains
  /// Enough points and parallax, and no second motion that fits nearly as well (paper eq.
  /// (8)-(10)).
  bool is_decisive = false;
  std::vector<char> inlier_mask;  ///< one per match, 1: inlier
};

/// Motion between two images from matches alone, input pixels: homography against fundamental
/// matrix, the point test, refinement on the inliers (paper section 3.5-3.7; keys `two_view.*`,
/// `odometry.*` and `seed` of the options). The same result for the same input. Error: a camera or
/// options that are none, not as many points in one image as in the other, a point that is not
/// finite.
[[nodiscard]] Expected<TwoViewResult> estimate_two_view(std::span<const Eigen::Vector2d> prev_uv,
                                                        std::span<const Eigen::Vector2d> cur_uv,
                                                        const Camera& camera,
                                                        const Options& options = {});

}  // namespace stemvo
