// SPDX-License-Identifier: MIT
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "stemvo/camera.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// The unknowns of a bundle adjustment, in any one unit of length.
struct BundleState {
  std::vector<Rigid3> camera_from_world;
  std::vector<Eigen::Vector3d> points;
  Camera camera;
  /// The distortion that the camera lacks: x' = x (1 + k1 r^2 + k2 r^4) of normalized coordinates.
  Eigen::Vector2d radial = Eigen::Vector2d::Zero();
};

/// Poses and points that see each other.
struct Bundle : BundleState {
  struct Observation {
    int pose = 0;
    int point = 0;
    Eigen::Vector2d uv;
  };
  std::vector<Observation> observations;  ///< ordered by point, then by pose: one of each
  int num_fixed_points = 0;               ///< the first ones, which stay where they are
};

/// Changes of cx, cy (px), of the focal lengths (share), k1, k2.
using IntrinsicsDelta = Eigen::Matrix<double, 5, 1>;
/// One change, then another: the focal lengths' factors multiply.
[[nodiscard]] inline IntrinsicsDelta compose(const IntrinsicsDelta& first,
                                             const IntrinsicsDelta& then) {
  IntrinsicsDelta total = first + then;
  total[2] += first[2] * then[2];
  return total;
}
/// The change that completes `first` to `total`.
[[nodiscard]] inline IntrinsicsDelta difference(const IntrinsicsDelta& total,
                                                const IntrinsicsDelta& first) {
  IntrinsicsDelta rest = total - first;
  rest[2] /= 1.0 + first[2];
  return rest;
}
/// k1 and k2 are left: a camera of frames without distortion has none.
[[nodiscard]] inline Camera changed(Camera camera, const IntrinsicsDelta& by) {
  camera.cx_px += by[0];
  camera.cy_px += by[1];
  camera.fx_px *= 1.0 + by[2];
  camera.fy_px *= 1.0 + by[2];
  return camera;
}
using CameraInformation = Eigen::Matrix<double, 5, 5>;

/// The camera as several bundles tell it.
struct CameraEstimate {
  IntrinsicsDelta change = IntrinsicsDelta::Zero();
  IntrinsicsDelta sigma = IntrinsicsDelta::Zero();  ///< standard deviations
  int num_bundles = 0;
};

/// The camera as it is known beforehand.
struct CameraPrior {
  IntrinsicsDelta mean;           ///< relative to the bundle's camera
  CameraInformation information;  ///< for observations of a noise of 1 px
};

struct BundleOptions {
  int num_fixed_poses = 2;  ///< the first ones; with fewer than 2 lengths are free
  int max_iterations = 10;
  double loss_scale_px = 0.2;           ///< Cauchy
  double min_relative_decrease = 5e-3;  ///< of the cost; a smaller one ends the minimization
  std::optional<CameraPrior> camera;    ///< the camera is an unknown too
};

struct BundleResult {
  bool is_usable = false;  ///< the cost fell; else the bundle is unchanged
  double cost = 0.0;       ///< sum of the robust loss, px^2
  IntrinsicsDelta camera_change = IntrinsicsDelta::Zero();
  /// Inverse covariance of the camera without its prior, all else left free, for observations of
  /// a noise of 1 px.
  CameraInformation information = CameraInformation::Zero();
};

/// Bundle adjustment (Triggs et al., 2000): reprojection error under Cauchy's loss,
/// Levenberg-Marquardt, the points eliminated by the Schur complement. Every point must lie in
/// front of every pose that sees it. One thread; the same bytes on every run.
BundleResult solve_bundle_adjustment(Bundle& bundle, const BundleOptions& options);

}  // namespace stemvo
