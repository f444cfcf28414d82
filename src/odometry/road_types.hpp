// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>
#include <string_view>

#include <Eigen/Core>

#include "stemvo/geometry/rigid3.hpp"

namespace stemvo {

/// What the road scale assumes of the car and of the road. Lengths are metres on the road.
struct RoadOptions {
  double camera_height_m = 1.65;
  double half_width_m = 1.6;         ///< of the strip of road that is looked at
  double far_m = 22.0;               ///< its far end; the near end is the picture's
  double rotation_sigma_rad = 2e-4;  ///< of the given motion's rotation, per axis
  double convergence = 1e-3;         ///< relative change of the plane that ends the refinement
  double slope_sigma = 0.003;        ///< of the road against the direction of travel
  double flatness_sigma = 0.03;      ///< error of log_scale that neighbouring frames share
  double drift_sigma = 0.002;        ///< of log(metres per unit), per frame
  double min_baseline_m = 0.4;       ///< pairs of frames are taken this far apart
  int max_frames_apart = 4;
};

/// What is believed of the road before a pair of frames is looked at. The plane is that of the
/// *current* camera: points X with (-roll, 1, -slope) . X = height (both small),
/// that is y = height + slope * z + roll * x.
struct RoadPrior {
  double log_scale = 0.0;        ///< see RoadMeasurement
  double log_scale_sigma = 0.5;  ///< above ~0.05 the estimators search first
  double slope_rad = 0.0;        ///< > 0: the ground falls away from the optical axis
  double slope_sigma = 0.03;
  double roll_rad = 0.0;
  double roll_sigma = 0.03;
};

/// What one pair of frames tells about the road.
struct RoadMeasurement {
  bool is_valid = false;
  double log_scale = 0.0;  ///< log(metres / unit of the given translation)
  double sigma = 0.0;      ///< of log_scale
  double slope_rad = 0.0;
  double roll_rad = 0.0;
  int num_points = 0;            ///< tracks or tiles that agreed
  double quality = 0.0;          ///< correlation (dense) or share of inliers (points), 0..1
  std::string_view reason = "";  ///< why it is not valid
};

/// The plane as m = n / d: m . X = 1 for its points X in the camera, in units of the translation.
[[nodiscard]] inline Eigen::Vector3d road_plane(double log_scale,
                                                double slope_rad,
                                                double roll_rad,
                                                double camera_height_m) {
  const Eigen::Vector3d normal = Eigen::Vector3d(-roll_rad, 1.0, -slope_rad).normalized();
  return normal * (std::exp(log_scale) / camera_height_m);
}

}  // namespace stemvo
