// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Core>
#include <ceres/sized_cost_function.h>

#include "odometry/window.hpp"
#include "stemvo/camera.hpp"

namespace stemvo {

struct BundleAdjustmentOptions {
  /// The oldest. Two hold the gauge, scale included; with one the length of the window is kept,
  /// from the oldest keyframe to the last but one.
  int num_fixed_keyframes = 2;
  int max_iterations = 10;
  /// Cauchy scale on the reprojection error: at least this ..
  double loss_scale_px = 0.2;
  /// .. and so many times the median error: a lens or a shutter that the camera model does not know
  /// makes every observation worse.
  double loss_share = 2.0;
  int min_observations = 2;  ///< of a landmark that takes part
};

/// Sliding-window bundle adjustment: poses of the window and its landmarks, robust reprojection
/// error, Schur complement over the landmarks. One thread: the same bytes on every run. False: too
/// little to do, or not solved; the window is unchanged.
bool refine_window(Window& window, const Camera& camera, const BundleAdjustmentOptions& options);

/// Reprojection error (px) of a landmark in a keyframe, with its derivatives. Parameters: a change
/// of the keyframe's pose (rotation vector w, rad, and translation t) and the point in the world X;
/// x = exp(w) R X + t in the camera, where R is the rotation the change starts from.
class ReprojectionCost final : public ceres::SizedCostFunction<2, 6, 3> {
 public:
  /// Points nearer than this (or behind) have no residual; map units.
  static constexpr double kMinDepth = 1e-6;

  /// The rotation must outlive the cost: the keyframe's observations share it.
  ReprojectionCost(const Camera& camera, const Eigen::Matrix3d& rotation, const Eigen::Vector2d& uv)
      : camera_(camera), rotation_(rotation), uv_(uv) {}

  /// False for a point behind the camera: the solver takes a shorter step.
  bool Evaluate(const double* const* parameters,
                double* residuals,
                double** jacobians) const override;

 private:
  const Camera& camera_;
  const Eigen::Matrix3d& rotation_;
  Eigen::Vector2d uv_;
};

}  // namespace stemvo
