// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cmath>
#include <vector>

#include <Eigen/Core>
#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include "mapping/kept_map.hpp"
#include "mapping/map_tracks.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// camera_from_map: x = exp(w) rotation X + translation + v, with (w, v) the unknowns.
struct AdjustedPose {
  explicit AdjustedPose(const Rigid3& camera_from_map)
      : rotation(camera_from_map.rotation_matrix()), translation(camera_from_map.translation) {}

  [[nodiscard]] Rigid3 camera_from_map() const {
    const Eigen::Quaterniond turn = so3_exp(Eigen::Vector3d(delta.data()));
    return {turn * Eigen::Quaterniond(rotation), translation + Eigen::Vector3d(&delta[3])};
  }
  /// The same pose around which (w, v) is 0.
  void take_in() { *this = AdjustedPose(camera_from_map()); }

  Eigen::Matrix3d rotation;
  Eigen::Vector3d translation;
  std::array<double, 6> delta = {};
};

/// A landmark's ray (a, b, 1) and inverse depth among the axes of a camera that stands still: one
/// far away moves as easily as a near one.
struct AdjustedPoint {
  Rigid3 map_from_anchor;
  std::array<double, 3> at = {};

  [[nodiscard]] Eigen::Vector3d in_map() const {
    const Eigen::Vector3d scaled = map_from_anchor.rotation * Eigen::Vector3d(at[0], at[1], 1.0) +
                                   at[2] * map_from_anchor.translation;
    return scaled / at[2];
  }
};

/// The point nearest to what its views show as these rays on the plane z = 1: along the first one,
/// linear in the inverse depth. `poses`: one per keyframe. False: a view has it behind.
[[nodiscard]] bool triangulate(const std::vector<AdjustedPose>& poses,
                               const MapTrack& track,
                               const std::vector<Eigen::Vector2d>& rays,
                               AdjustedPoint& point);

/// A corner's reprojection error in its sigmas. Unknowns: the point, the pose, the camera: changes
/// as IntrinsicsDelta, and a sixth that does nothing (Ceres is three times as fast where poses and
/// camera are of one size).
class CornerError final : public ceres::SizedCostFunction<2, 3, 6, 6> {
 public:
  CornerError(const Eigen::Vector2d& uv,
              const Camera& camera,
              const AdjustedPoint& point,
              const AdjustedPose& pose,
              const double& sigma_px)
      : uv_(uv), camera_(camera), point_(point), pose_(pose), sigma_px_(sigma_px) {}

  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override;

 private:
  Eigen::Vector2d uv_;
  const Camera& camera_;
  const AdjustedPoint& point_;
  const AdjustedPose& pose_;
  const double& sigma_px_;
};

/// The motion between two poses, from_from_to.
template <typename T>
struct MotionBetween {
  using Matrix = Eigen::Matrix<T, 3, 3>;
  using Vector = Eigen::Matrix<T, 3, 1>;

  MotionBetween(const AdjustedPose& from, const AdjustedPose& to, const T* at_from, const T* at_to)
      : rotation(rotation_of(from, at_from) * rotation_of(to, at_to).transpose()),
        translation(translation_of(from, at_from) - rotation * translation_of(to, at_to)) {}

  Matrix rotation;
  Vector translation;

 private:
  static Matrix rotation_of(const AdjustedPose& pose, const T* at) {
    Matrix turn;
    ceres::AngleAxisToRotationMatrix(at, turn.data());
    return turn * pose.rotation.template cast<T>();
  }
  static Vector translation_of(const AdjustedPose& pose, const T* at) {
    return pose.translation.template cast<T>() + Eigen::Map<const Vector>(at + 3);
  }
};

/// Rotation and translation of an edge, in their sigmas. A unit of `from` is `scale` of the map,
/// known as well as the edge tells scale.
struct EdgeError {
  EdgeError(const MapEdge& edge,
            double scale,
            const AdjustedPose& from_pose,
            const AdjustedPose& to_pose)
      : from(from_pose),
        to(to_pose),
        rotation(edge.from_to.rotation.toRotationMatrix()),
        way(scale * edge.from_to.translation),
        sigma_rad(edge.sigma_rad) {
    const double across = scale * edge.sigma_translation;
    const double along = std::hypot(across, edge.sigma_log_scale * way.norm());
    const Eigen::Vector3d direction = way.normalized();
    whiten = Eigen::Matrix3d::Identity() / across +
             (1.0 / along - 1.0 / across) * direction * direction.transpose();
  }

  template <typename T>
  bool operator()(const T* at_from, const T* at_to, T* residual) const {
    using Vector = Eigen::Matrix<T, 3, 1>;
    const MotionBetween<T> motion(from, to, at_from, at_to);
    const Eigen::Matrix<T, 3, 3> off = rotation.transpose().template cast<T>() * motion.rotation;
    ceres::RotationMatrixToAngleAxis(off.data(), residual);
    Eigen::Map<Vector> turn(residual);
    turn /= T(sigma_rad);
    Eigen::Map<Vector>(residual + 3) =
        whiten.template cast<T>() * (motion.translation - way.template cast<T>());
    return true;
  }

  const AdjustedPose& from;
  const AdjustedPose& to;
  Eigen::Matrix3d rotation;
  Eigen::Vector3d way;
  double sigma_rad;
  Eigen::Matrix3d whiten;
};

/// The logarithm of the distance between two poses, in its sigmas.
struct DistanceError {
  const AdjustedPose& from;
  const AdjustedPose& to;
  double log_distance;
  double sigma;

  template <typename T>
  bool operator()(const T* at_from, const T* at_to, T* residual) const {
    const MotionBetween<T> motion(from, to, at_from, at_to);
    residual[0] = (0.5 * log(motion.translation.squaredNorm()) - log_distance) / sigma;
    return true;
  }
};

/// A residual block, and which others have errors like its own.
struct ClusteredResidual {
  ceres::ResidualBlockId block;
  int cluster = -1;  ///< -1: its errors are nobody's, with the sigmas it has
};

/// Covariances of blocks of six unknowns of a solved problem. Errors of one cluster may be alike in
/// any way, those of different ones are independent: what each cluster moves a block by is summed
/// up in squares (the sandwich estimator), and no less than independent errors would. Sigmas are
/// multiplied by `sigma_factor`. `free`: all that are not constant. Zero where there is no
/// solution.
[[nodiscard]] std::vector<Eigen::Matrix<double, 6, 6>> clustered_covariances(
    ceres::Problem& problem,
    const std::vector<double*>& free,
    const std::vector<ClusteredResidual>& residuals,
    const std::vector<double*>& asked,
    double sigma_factor);

}  // namespace stemvo
