// SPDX-License-Identifier: MIT
#pragma once

#include <array>

#include <Eigen/Core>

#include "stemvo/camera.hpp"

namespace stemvo::calibration {

/// What all keyframes share: f, cx, cy (px), k1, k2. f is the mean of fx and fy, whose ratio stays.
/// k1 and k2 are the radial distortion 1 + k1 r^2 + k2 r^4 that a rectification leaves.
inline constexpr int kNumShared = 5;
inline constexpr int kNumIntrinsics = 3;  ///< the first of them, which calib.txt holds
using SharedVector = Eigen::Matrix<double, kNumShared, 1>;
/// Which of them are refined.
using SharedMask = std::array<bool, kNumShared>;

/// fx / f and fy / f.
[[nodiscard]] inline Eigen::Vector2d focal_shares(const Camera& camera) {
  return Eigen::Vector2d(camera.fx_px, camera.fy_px) / camera.mean_focal_px();
}

[[nodiscard]] inline SharedVector shared_of(const Camera& camera) {
  return {camera.mean_focal_px(), camera.cx_px, camera.cy_px, 0.0, 0.0};
}

/// `given` with f, cx, cy replaced.
[[nodiscard]] inline Camera with_shared(const Camera& given, const SharedVector& shared) {
  const Eigen::Vector2d focal = focal_shares(given) * shared[0];
  return {focal.x(), focal.y(), shared[1], shared[2], given.width_px, given.height_px};
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

}  // namespace stemvo::calibration
