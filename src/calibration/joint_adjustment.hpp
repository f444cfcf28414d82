// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include <Eigen/Core>
#include <ceres/problem.h>

#include "calibration/segments.hpp"
#include "calibration/shared_camera.hpp"
#include "stemvo/camera.hpp"

namespace stemvo::calibration {

/// What the drive tells of the shared numbers once poses and landmarks are eliminated.
struct SharedInformation {
  Eigen::Matrix<double, kNumShared, kNumShared> hessian;  ///< of half the robust cost
  std::vector<SharedVector> gradients;                    ///< of each segment's part of it
};

/// Bundle adjustment of all segments at once: poses, landmarks and the camera they share, robust
/// reprojection error (Cauchy). The first keyframe of a segment and one coordinate of its last one
/// hold the gauge.
class JointAdjustment {
 public:
  static constexpr int kMaxIterations = 30;

  JointAdjustment(const std::vector<Segment>& segments, const Camera& given);

  /// Called after each iteration; false stops.
  using Callback = std::function<bool()>;
  /// Moves poses, landmarks and the free ones of the shared numbers; all stay where it is stopped
  /// or not solvable. One thread: same input, same bits.
  void solve(const SharedMask& is_free, double loss_scale_px, const Callback& callback);

  /// Drops observations that are farther off, then landmarks with fewer than three left.
  void reject_outliers(double bound_px);

  /// Reprojection error of every observation; infinite behind the camera.
  [[nodiscard]] std::vector<double> errors_px() const;
  /// Here and now.
  [[nodiscard]] SharedInformation information(double loss_scale_px);

  [[nodiscard]] std::size_t num_keyframes() const { return poses_.size(); }
  [[nodiscard]] std::size_t num_landmarks() const { return landmarks_.size(); }
  [[nodiscard]] double turned_rad() const;

  SharedVector shared;

 private:
  /// Residuals in the order of the landmarks, then of their observations.
  std::vector<ceres::ResidualBlockId> build(double loss_scale_px, ceres::Problem& problem);
  /// Those of the problem that are not held.
  std::vector<double*> pose_blocks(const ceres::Problem& problem);
  [[nodiscard]] double error_px(const Landmark& landmark, const Observation& seen) const;

  // One list for all segments: Ceres eliminates blocks in the order of their addresses, which must
  // not depend on where segments lie in memory.
  Eigen::Vector2d focal_share_;
  std::vector<std::size_t> ends_;    ///< per segment: behind its last keyframe
  std::vector<Rigid3> poses_;        ///< camera_from_first
  std::vector<Landmark> landmarks_;  ///< whose observations count the keyframes of all segments
};

}  // namespace stemvo::calibration
