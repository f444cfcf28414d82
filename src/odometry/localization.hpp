// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "odometry/window.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// The landmarks that a frame sees, and where.
struct SeenLandmarks {
  std::vector<Eigen::Vector3d> points;  ///< in the world
  std::vector<Eigen::Vector2d> uv;
  std::vector<int> track_ids;  ///< rising

  [[nodiscard]] int size() const { return static_cast<int>(points.size()); }
};
/// The landmarks that the mask keeps.
[[nodiscard]] SeenLandmarks select(const SeenLandmarks& seen, const std::vector<char>& mask);
[[nodiscard]] SeenLandmarks find_seen_landmarks(const Window& window, const Observations& frame);

/// Projections of the landmarks in front of the camera that are not among the frame's points.
[[nodiscard]] Observations project_lost_landmarks(const Window& window,
                                                  const Rigid3& world_from_camera,
                                                  const Observations& frame,
                                                  const Camera& camera);

/// How far from where the camera has each landmark it is seen, px; infinite: behind it.
[[nodiscard]] std::vector<double> distances_px(const SeenLandmarks& seen,
                                               const Rigid3& camera_from_world,
                                               const Camera& camera);

/// Which of two world_from_camera the landmarks fit better, by the median of their distances to
/// where they are seen; the first where both do alike.
[[nodiscard]] Rigid3 nearer_pose(const Rigid3& first,
                                 const Rigid3& second,
                                 const SeenLandmarks& seen,
                                 const Camera& camera);

struct LocalizationOptions {
  double first_loss_px = 2.0;  ///< Cauchy scale of the first round: the prediction may be far off
  double loss_px = 0.2;        ///< of the second, on the inliers of the first
  double inlier_bound_px = 4.0;
  int min_landmarks = 10;      ///< that agree with a pose; fewer: there is none
  double min_agreement = 0.5;  ///< share of the landmarks seen; less: the prediction was wrong
  std::uint64_t seed = 1;      ///< of the search without a prediction
};

struct Localization {
  Rigid3 world_from_camera;
  int num_inliers = 0;  ///< of all landmarks seen, within the bound
};

/// Pose of a frame by the landmarks it sees: motion-only optimization (Cauchy loss) from a
/// predicted pose, in two rounds, outliers left out between them. Where fewer than
/// `min_agreement` agree, it is searched without a prediction (P3P consensus) and the better one
/// counts, however few that are. nullopt: fewer than `min_landmarks` agree with any pose.
[[nodiscard]] std::optional<Localization> localize(const SeenLandmarks& seen,
                                                   const Rigid3& predicted_world_from_camera,
                                                   const Camera& camera,
                                                   const LocalizationOptions& options);

/// How far the way from `position` to the frame's own moves its landmarks in the image (root mean
/// square, pixels), once a rotation has done what it can. nullopt: too few landmarks are within
/// `bound_px` to tell.
[[nodiscard]] std::optional<double> parallax_since_px(const Eigen::Vector3d& position,
                                                      const Rigid3& world_from_camera,
                                                      const SeenLandmarks& seen,
                                                      const Camera& camera,
                                                      double bound_px);

}  // namespace stemvo
