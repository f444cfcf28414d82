// SPDX-License-Identifier: MIT
#include "mapping/map_motions.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "geometry/median.hpp"
#include "geometry/pose_influence.hpp"
#include "odometry/localization.hpp"

namespace stemvo {
namespace {

/// Errors of a track's points are alike: so many times the sigmas of independent ones.
constexpr double kAlikeFactor = 3.0;
/// Standard deviations of a motion between two keyframes: what a camera bends besides the noise of
/// tracks. Rotation, share of the depth, scale.
constexpr double kMotionSigma_rad = 5e-4;
constexpr double kMotionSigma = 2e-3;
constexpr double kMotionLogScale = 6e-3;
/// A guess's standard deviation of the rotation.
constexpr double kGuess_rad = 1.0;

Similarity3 scaled(double factor, const Rigid3& motion) {
  return {1.0, motion.rotation, factor * motion.translation};
}

double parallax_rad(const Eigen::Vector3d& point, const Rigid3& a, const Rigid3& b) {
  const Eigen::Vector3d from_a = point - a.translation;
  const Eigen::Vector3d from_b = point - b.translation;
  return std::atan2(from_a.cross(from_b).norm(), from_a.dot(from_b));
}

/// How well the landmarks that both keyframes see carry the scale over: each by the parallax that
/// its depth comes from, of points with a noise of 1 px.
double log_scale_sigma(const Window& window,
                       const Keyframe& from,
                       const Keyframe& to,
                       double f_px) {
  const SeenLandmarks shared = find_seen_landmarks(window, from.points);
  ObservationWalk walk(window);
  double information = 0.0;
  for (std::size_t i = 0; i < shared.points.size(); ++i) {
    if (find_point(to.points, shared.track_ids[i]) == nullptr) {
      continue;
    }
    const auto seen = walk.seek(shared.track_ids[i]);
    const double parallax_px =
        f_px * parallax_rad(shared.points[i],
                            window.keyframes[seen.front().keyframe].world_from_camera,
                            window.keyframes[seen.back().keyframe].world_from_camera);
    information += parallax_px * parallax_px;
  }
  return 1.0 / std::sqrt(std::max(information, 1.0));
}

}  // namespace

MapEdge motion_between(const WindowView& view, const Keyframe& from, const Keyframe& to, int node) {
  const double units_of_from = view.history.units(from.frame);
  const double units_of_to = view.history.units(to.frame);
  const Rigid3 from_to = from.world_from_camera.inverse() * to.world_from_camera;
  MapEdge edge{.from = node, .to = node + 1, .from_to = scaled(units_of_from, from_to)};
  edge.from_to.scale = units_of_from / units_of_to;
  const SeenLandmarks seen = find_seen_landmarks(view.window, to.points);
  const Rigid3 camera_from_world = to.world_from_camera.inverse();
  std::vector<double> errors;
  std::vector<double> depths;
  for (std::size_t i = 0; i < seen.points.size(); ++i) {
    const Eigen::Vector3d point = camera_from_world * seen.points[i];
    errors.push_back((view.camera.project(point) - seen.uv[i]).norm());
    depths.push_back(point.z());
  }
  const double depth = depths.empty() ? from_to.translation.norm() : median(std::move(depths));
  // Lengths of noise with equal sigmas in u and v have Rayleigh's distribution.
  const double noise_px = errors.empty() ? 1.0 : median(std::move(errors)) / 1.1774;
  const Matrix6d pose =
      pose_influences(camera_from_world, seen.points, seen.uv, view.camera, noise_px).squared_sum();
  const auto sigma = [&](const auto& covariance) {
    return kAlikeFactor * std::sqrt(covariance.trace() / 3.0);
  };
  edge.sigma_rad = std::hypot(kMotionSigma_rad, sigma(pose.bottomRightCorner<3, 3>()));
  edge.sigma_translation =
      units_of_from * std::hypot(kMotionSigma * depth, sigma(pose.topLeftCorner<3, 3>()));
  edge.sigma_log_scale = std::hypot(
      kMotionLogScale, kAlikeFactor * noise_px *
                           log_scale_sigma(view.window, from, to, view.camera.mean_focal_px()));
  return edge;
}

MapEdge guessed_motion(const KeptKeyframe& from, const KeptKeyframe& to, int node) {
  const Rigid3 from_to = from.world_from_camera.inverse() * to.world_from_camera;
  return {node,
          node + 1,
          Similarity3(from_to),
          kGuess_rad,
          std::max(1.0, from_to.translation.norm()),
          kGuessLogScale};
}

}  // namespace stemvo
