// SPDX-License-Identifier: MIT
#pragma once

#include <array>

#include <Eigen/Core>

namespace stemvo {

/// OpenCV's maps of pixels hold no larger coordinate.
inline constexpr int kMaxImageSide_px = 32767;

enum class Distortion {
  kNone,
  kRadialTangential,  ///< OpenCV's k1 k2 p1 p2 k3, k4 k5 k6, s1 s2 s3 s4
  kEquidistant,       ///< OpenCV's fisheye k1 k2 k3 k4
};

/// Pinhole camera. Pixels: the centre of the top-left pixel is (0, 0). Camera axes: x right, y
/// down, z forward.
struct Camera {
  double fx_px = 0.0;
  double fy_px = 0.0;
  double cx_px = 0.0;
  double cy_px = 0.0;
  int width_px = 0;
  int height_px = 0;
  /// The lens, which the odometry takes out of its images first. The functions below know none.
  Distortion distortion = Distortion::kNone;
  std::array<double, 12> distortion_coefficients = {};  ///< those a model does not have are 0

  /// 3x3 intrinsics K.
  [[nodiscard]] Eigen::Matrix3d matrix() const {
    Eigen::Matrix3d k;
    k << fx_px, 0.0, cx_px, 0.0, fy_px, cy_px, 0.0, 0.0, 1.0;
    return k;
  }
  /// Pixel -> point on the plane z = 1.
  [[nodiscard]] Eigen::Vector2d normalize(const Eigen::Vector2d& uv) const {
    return {(uv.x() - cx_px) / fx_px, (uv.y() - cy_px) / fy_px};
  }
  /// Point in camera coordinates (z != 0) -> pixel. Points behind the camera are projected as well:
  /// the caller checks z > 0.
  [[nodiscard]] Eigen::Vector2d project(const Eigen::Vector3d& point) const {
    return {fx_px * point.x() / point.z() + cx_px, fy_px * point.y() / point.z() + cy_px};
  }
  /// Mean focal length, to turn pixel thresholds into normalised ones.
  [[nodiscard]] double mean_focal_px() const { return 0.5 * (fx_px + fy_px); }
};

}  // namespace stemvo
