// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "stemvo/geometry/camera.hpp"

namespace stemvo::calibration {

/// What all keyframes share: f, cx, cy (px), k1, k2. f is the mean of fx and fy, whose ratio stays.
/// k1 and k2 are the radial distortion 1 + k1 r^2 + k2 r^4 that a rectification leaves.
inline constexpr int kNumShared = 5;
inline constexpr int kNumIntrinsics = 3;  ///< the first of them, which calib.txt holds
using SharedVector = Eigen::Matrix<double, kNumShared, 1>;
using SharedMatrix = Eigen::Matrix<double, kNumShared, kNumShared>;

/// fx / f and fy / f.
[[nodiscard]] inline Eigen::Vector2d focal_shares(const Camera& camera) {
  return Eigen::Vector2d(camera.fx_px, camera.fy_px) / camera.mean_focal_px();
}

[[nodiscard]] inline SharedVector shared_of(const Camera& camera) {
  SharedVector shared = SharedVector::Zero();
  shared.head<kNumIntrinsics>() << camera.mean_focal_px(), camera.cx_px, camera.cy_px;
  return shared;
}

/// `given` with f, cx, cy replaced.
[[nodiscard]] inline Camera with_shared(const Camera& given, const SharedVector& shared) {
  const Eigen::Vector2d share = focal_shares(given);
  Camera camera = given;
  camera.fx_px = share.x() * shared[0];
  camera.fy_px = share.y() * shared[0];
  camera.cx_px = shared[1];
  camera.cy_px = shared[2];
  return camera;
}

/// Point in the camera -> pixel; `shared` points at kNumShared numbers.
template <typename T>
Eigen::Matrix<T, 2, 1> project_shared(const Eigen::Vector2d& focal_share,
                                      const T* shared,
                                      const Eigen::Matrix<T, 3, 1>& x) {
  const Eigen::Matrix<T, 2, 1> xy(x.x() / x.z(), x.y() / x.z());
  const T r2 = xy.squaredNorm();
  const T f = shared[0] * (T(1.0) + r2 * (shared[3] + r2 * shared[4]));
  return {focal_share.x() * f * xy.x() + shared[1], focal_share.y() * f * xy.y() + shared[2]};
}

/// Reprojection error (px) of a homogeneous landmark, for automatic differentiation. Parameters:
/// the shared camera, camera_from_first as unit quaternion (x, y, z, w) and translation, the point.
struct SharedCameraCost {
  Eigen::Vector2d focal_share;
  Eigen::Vector2d uv;

  template <typename T>
  bool operator()(
      const T* shared, const T* rotation, const T* translation, const T* point, T* residual) const {
    const Eigen::Map<const Eigen::Quaternion<T>> q(rotation);
    const Eigen::Map<const Eigen::Matrix<T, 3, 1>> t(translation);
    const Eigen::Map<const Eigen::Matrix<T, 3, 1>> direction(point);
    const Eigen::Matrix<T, 3, 1> x = q * direction + point[3] * t;
    if (!(x.z() > T(1e-6))) {
      return false;  // the solver takes a shorter step
    }
    Eigen::Map<Eigen::Matrix<T, 2, 1>> error(residual);
    error = project_shared(focal_share, shared, x) - uv.template cast<T>();
    return true;
  }
};

}  // namespace stemvo::calibration
