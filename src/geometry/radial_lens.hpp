// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Core>

#include "stemvo/camera.hpp"

namespace stemvo {

/// The radial distortion that frames still have where their camera was thought to have none:
/// x' = x (1 + k1 r^2 + k2 r^4) of normalized coordinates, as IntrinsicsDelta.
struct RadialLens {
  Eigen::Vector2d center_px = Eigen::Vector2d::Zero();
  Eigen::Vector2d focal_px = Eigen::Vector2d::Ones();
  Eigen::Vector2d k = Eigen::Vector2d::Zero();

  /// Pixel of a pinhole -> pixel of the frame.
  [[nodiscard]] Eigen::Vector2d distort(const Eigen::Vector2d& uv) const {
    return uv + (factor(uv) - 1.0) * (uv - center_px);
  }
  /// Pixel of the frame -> pixel of a pinhole.
  [[nodiscard]] Eigen::Vector2d undistort(const Eigen::Vector2d& uv) const {
    constexpr int kNumSteps = 4;  // each leaves a few hundredths of the error: k is small
    Eigen::Vector2d ideal = uv;
    for (int i = 0; i < kNumSteps && !k.isZero(); ++i) {
      ideal = center_px + (uv - center_px) / factor(ideal);
    }
    return ideal;
  }

 private:
  [[nodiscard]] double factor(const Eigen::Vector2d& uv) const {
    const double r_sq = (uv - center_px).cwiseQuotient(focal_px).squaredNorm();
    return 1.0 + r_sq * (k[0] + r_sq * k[1]);
  }
};

[[nodiscard]] inline RadialLens radial_lens(const Camera& camera, const Eigen::Vector2d& k) {
  return {{camera.cx_px, camera.cy_px}, {camera.fx_px, camera.fy_px}, k};
}

}  // namespace stemvo
