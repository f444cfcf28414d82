// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "geometry/pixel_pairs.hpp"
#include "geometry/pose_influence.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/frame_result.hpp"
#include "stemvo/options.hpp"
#include "stemvo/two_view.hpp"

namespace stemvo {

/// The motion between two frames as they tell it.
struct MeasuredMotion : TwoViewResult {
  /// The error of cur_from_prev^-1 (relative_pose_covariance); zero unless tracking.
  Matrix6d covariance = Matrix6d::Zero();
  double homography_score = 0.0;   ///< S_H
  double fundamental_score = 0.0;  ///< S_F
  int num_inliers = 0;
  std::vector<char> moving_mask;              ///< of an Initializer: it moves on its own
  std::optional<Eigen::Matrix3d> homography;  ///< pixels; the models that were scored
  std::optional<Eigen::Matrix3d> essential;   ///< normalised coordinates
};

/// Two-frame motion, paper section 3.5-3.7: score H against F while initialising, the essential
/// matrix afterwards, the point test, then refinement of R and t on the inliers.
class TwoViewEstimator {
 public:
  explicit TwoViewEstimator(const Options& config)
      : options_(config.two_view), odometry_(config.odometry), seed_(config.seed) {}

  /// `is_initializing`: let R_H choose the model.
  [[nodiscard]] MeasuredMotion measure(const PixelPairs& pairs,
                                       const Camera& camera,
                                       bool is_initializing) const;
  /// Refines a motion on its inliers, and finds inliers, parallax and state anew.
  void refine(const PixelPairs& pairs, const Camera& camera, MeasuredMotion& result) const;

 private:
  void score_models(const PixelPairs& pairs,
                    const Camera& camera,
                    bool is_initializing,
                    MeasuredMotion& result) const;

  TwoViewOptions options_;
  OdometryOptions odometry_;
  std::uint64_t seed_;
};

/// S_H, S_F, R_H and the model.
void add_scores(const MeasuredMotion& motion, FrameResult& result);

}  // namespace stemvo
