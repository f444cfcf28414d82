// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Core>

#include "odometry/road_types.hpp"

namespace stemvo {

/// The unknowns of both estimators: a plane m (m . X = 1 in the current camera), the drop of the
/// road (see RoadPrior), and a small rotation w that corrects the given one, in this order.
using RoadVector = Eigen::Matrix<double, 7, 1>;
using RoadMatrix = Eigen::Matrix<double, 7, 7>;

/// Warp of the current picture into the previous one as the road moves.
struct RoadWarp {
  Eigen::Matrix3d given_rotation;  ///< prev_from_cur
  Eigen::Vector3d translation;     ///< prev_from_cur
  Eigen::Vector3d plane;           ///< m, in units of the translation
  double drop = 0.0;
  Eigen::Vector3d correction = Eigen::Vector3d::Zero();  ///< w, rad

  RoadWarp(const Rigid3& cur_from_prev, const RoadPrior& prior, double camera_height_m);
  [[nodiscard]] Eigen::Matrix3d rotation() const;
  /// 1/z where a ray (x, y, 1) meets the road: the solution of q^2 - (m . ray) q + drop |m|^2 = 0;
  /// 0 where it does not (sky, behind a crest).
  [[nodiscard]] double inverse_depth(const Eigen::Vector3d& ray) const;
};

/// Normal equations of a Gauss-Newton step.
struct RoadNormal {
  RoadMatrix information = RoadMatrix::Zero();
  RoadVector gradient = RoadVector::Zero();

  /// Groups of data (tiles, cells) that are not independent within: `spread` is the sum over the
  /// groups of the squares of their gradient by the plane. Where it exceeds what independent data
  /// would give, everything so far is worth less by that factor.
  void discount(const Eigen::Vector3d& spread);
  void add_prior(const RoadWarp& warp, const RoadPrior& prior, double rotation_sigma_rad);
  /// Moves the warp; false where there is no finite step or the plane tips over.
  [[nodiscard]] bool step(RoadWarp& warp);

  RoadMatrix covariance = RoadMatrix::Zero();  ///< of the last step
  double relative_change = 0.0;                ///< of the plane in the last step
};

/// What a warp and its covariance say, without the judgement.
[[nodiscard]] RoadMeasurement read_road(const RoadWarp& warp,
                                        const RoadMatrix& covariance,
                                        double camera_height_m);
/// A measurement that failed.
[[nodiscard]] RoadMeasurement no_road(std::string_view reason);
/// Finite and longer than zero.
[[nodiscard]] bool is_motion(const Rigid3& cur_from_prev);

}  // namespace stemvo
