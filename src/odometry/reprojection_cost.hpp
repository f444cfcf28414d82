// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "stemvo/geometry/camera.hpp"

namespace stemvo {

/// Reprojection error (px) of a landmark in a keyframe, for automatic differentiation. Parameters:
/// camera_from_world as unit quaternion (x, y, z, w) and translation, point in the world.
struct ReprojectionCost {
  Camera camera;
  Eigen::Vector2d uv;

  template <typename T>
  bool operator()(const T* rotation, const T* translation, const T* point, T* residual) const {
    const Eigen::Map<const Eigen::Quaternion<T>> q(rotation);
    const Eigen::Map<const Eigen::Matrix<T, 3, 1>> t(translation);
    const Eigen::Map<const Eigen::Matrix<T, 3, 1>> x_in_world(point);
    const Eigen::Matrix<T, 3, 1> x = q * x_in_world + t;
    if (!(x.z() > T(1e-6))) {
      return false;  // the solver takes a shorter step
    }
    residual[0] = camera.fx_px * x.x() / x.z() + camera.cx_px - uv.x();
    residual[1] = camera.fy_px * x.y() / x.z() + camera.cy_px - uv.y();
    return true;
  }
};

}  // namespace stemvo
