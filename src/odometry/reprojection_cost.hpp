// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <ceres/sized_cost_function.h>

#include "stemvo/geometry/camera.hpp"

namespace stemvo {

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
