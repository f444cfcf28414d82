// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>
#include <string_view>

#include <Eigen/Core>

#include "odometry/road/image.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// Assumptions of the road scale about the car and the road. Lengths are metres on the road.
struct RoadOptions {
  double camera_height_m = 1.65;
  double half_width_m = 1.6;         ///< of the strip of road that is looked at
  double far_m = 22.0;               ///< its far end; the near end is the image's
  double rotation_sigma_rad = 2e-4;  ///< of the given motion's rotation, per axis

  // The road's profile, from the path that was driven (RoadScale).
  double heave_sigma_m = 0.03;         ///< of the camera's height above the road
  double bend_sigma_per_m = 1e-3;      ///< of half the road's vertical curvature
  double path_m = 15.0;                ///< as far back as the path is used
  double free_slope_sigma_rad = 0.03;  ///< of the camera's pitch against an unknown road
  double roll_sigma_rad = 0.03;

  // Which pairs of frames, which estimators.
  double min_baseline_m = 0.4;  ///< of a pair of frames, if any in memory is that far away
  int max_frames_apart = 4;
  bool use_dense = true;
  bool use_points = true;

  // Joining over time.
  double flatness_sigma = 0.03;  ///< error of log_scale that both estimators and neighbours share

  // The estimators.
  double convergence = 3e-3;       ///< relative change of the plane that ends the refinement
  int max_points = 100;            ///< corners tracked on the road
  double corner_quality = 0.0005;  ///< of the best corner: asphalt is faint
  double corner_distance_px = 8.0;
  double max_loop_px = 0.3;      ///< forward and back again
  double max_off_line_px = 0.7;  ///< from the epipolar line of the given motion
};

/// The road as it is predicted before a pair of frames is looked at, in the *current* camera:
/// y = height + slope * z + roll * x + drop * z^2 / height, metres.
struct RoadPrior {
  double log_scale = 0.0;        ///< see RoadMeasurement
  double log_scale_sigma = 0.5;  ///< above 0.05 the scale is searched first
  double slope_rad = 0.0;        ///< > 0: the ground falls away from the optical axis
  double drop = 0.0;             ///< height * half the vertical curvature; > 0: over a crest
  /// Inverse covariance of (slope_rad, drop).
  Eigen::Matrix2d profile_information = Eigen::Vector2d(1e3, 1e8).asDiagonal();
  double roll_rad = 0.0;
  double roll_sigma = 0.03;
};

/// The road as one pair of frames tells it.
struct RoadMeasurement {
  bool is_valid = false;
  double log_scale = 0.0;  ///< log(metres / unit of the given translation)
  double sigma = 0.0;      ///< of log_scale, for a road as smooth as the model
  double slope_rad = 0.0;
  double roll_rad = 0.0;
  double drop = 0.0;
  double correlation = 0.0;      ///< dense: of the images, more than without the plane
  bool is_in_sight = true;       ///< false where the strip is not in the image: that proves nothing
  std::string_view reason = "";  ///< why it is not valid
};

/// A ray only touches the road where 1 - 4 drop |m|^2 / (m . ray)^2 is 0; nearer to it than this,
/// it is as good as behind the crest.
inline constexpr double kMinRoadRoot = 0.1;

/// The plane as m = n / d: m . X = 1 for its points X in the camera, in units of the translation.
[[nodiscard]] inline Eigen::Vector3d road_plane(double log_scale,
                                                double slope_rad,
                                                double roll_rad,
                                                double camera_height_m) {
  const Eigen::Vector3d normal = Eigen::Vector3d(-roll_rad, 1.0, -slope_rad).normalized();
  return normal * (std::exp(log_scale) / camera_height_m);
}

/// The unknowns of both estimators: a plane m (m . X = 1 in the current camera), the drop of the
/// road (see RoadPrior), and a small rotation w that corrects the given one, in this order.
using RoadVector = Eigen::Matrix<double, 7, 1>;
using RoadMatrix = Eigen::Matrix<double, 7, 7>;

/// Warp of the current image into the previous one as the road moves.
struct RoadWarp {
  Eigen::Matrix3d given_rotation;  ///< prev_from_cur
  Eigen::Vector3d translation;     ///< prev_from_cur
  Eigen::Vector3d plane;           ///< m, in units of the translation
  double drop = 0.0;
  Eigen::Vector3d correction = Eigen::Vector3d::Zero();  ///< w, rad

  RoadWarp(const Rigid3& cur_from_prev, const RoadPrior& prior, double camera_height_m)
      : given_rotation(cur_from_prev.inverse().rotation_matrix()),
        translation(cur_from_prev.inverse().translation),
        plane(road_plane(prior.log_scale, prior.slope_rad, prior.roll_rad, camera_height_m)),
        drop(prior.drop) {}
  [[nodiscard]] Eigen::Matrix3d rotation() const {
    return so3_exp(correction).toRotationMatrix() * given_rotation;
  }
  /// 1/z where a ray (x, y, 1) meets the road: the solution of q^2 - (m . ray) q + drop |m|^2 = 0;
  /// 0 where it does not (sky, behind a crest).
  [[nodiscard]] double inverse_depth(const Eigen::Vector3d& ray) const {
    const double flat = plane.dot(ray);
    const double root = 1.0 - 4.0 * drop * plane.squaredNorm() / (flat * flat);
    return flat > 0.0 && root > kMinRoadRoot ? 0.5 * flat * (1.0 + std::sqrt(root)) : 0.0;
  }
};

/// Normal equations of a Gauss-Newton step.
struct RoadNormal {
  RoadMatrix information = RoadMatrix::Zero();
  RoadVector gradient = RoadVector::Zero();

  /// Variance inflation by chi-square per degree of freedom: information and gradient are divided
  /// by max(1, mean_k of sum_g g_k^2 / H_kk), where g are the gradients by the plane of groups of
  /// data (tiles, cells) and `spread` is the sum of their squares. If all data are independent, a
  /// group's gradient has the variance of its share of the information H, and the ratio is 1. A
  /// bump or a kerb moves all data of a group at once: then the sum of squares exceeds H by as much
  /// as the data are worth less.
  void inflate_variance(const Eigen::Vector3d& spread);
  void add_prior(const RoadWarp& warp, const RoadPrior& prior, double rotation_sigma_rad);
  /// Moves the warp; false where there is no finite step or the plane tips over.
  [[nodiscard]] bool step(RoadWarp& warp);

  RoadMatrix covariance = RoadMatrix::Zero();  ///< of the last step
  double relative_change = 0.0;                ///< of the plane in the last step
};

/// Reads a warp and its covariance, without the judgement.
[[nodiscard]] RoadMeasurement read_road(const RoadWarp& warp,
                                        const RoadMatrix& covariance,
                                        double camera_height_m);
/// A measurement that failed.
[[nodiscard]] RoadMeasurement no_road(std::string_view reason, bool is_in_sight = true);

/// Two frames, and what is believed before they are compared.
struct RoadStep {
  const RoadImage& prev;
  const RoadImage& cur;
  const Rigid3& cur_from_prev;  ///< in any unit of length
  const RoadPrior& prior;       ///< about that unit
  const RoadOptions& options;
};

/// The road's plane by direct alignment: the strip of road in the current image is warped into the
/// previous one by the homography of the plane, H = R + t m^T, and m is refined (Gauss-Newton on
/// the normalised images; small errors of the given rotation are estimated along with it).
[[nodiscard]] RoadMeasurement measure_dense(const RoadStep& step);

/// The road by points: faint corners in the strip of road are tracked into the previous image,
/// warped as the predicted plane moves (so that fast and plain asphalt cannot lead the tracker
/// astray); those on the epipolar lines of the given motion are fitted by a plane: its depths, put
/// through the motion, must meet the tracks. The prior's log_scale must be right within some 10 %.
[[nodiscard]] RoadMeasurement measure_points(const RoadStep& step);

}  // namespace stemvo
