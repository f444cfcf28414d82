// SPDX-License-Identifier: MIT
#include "odometry/localization.hpp"

#include "odometry/robust_models.hpp"
#include "stemvo/geometry/absolute_pose.hpp"

namespace stemvo {
namespace {

SeenLandmarks select(const SeenLandmarks& seen, const std::vector<char>& mask) {
  SeenLandmarks selected;
  for (std::size_t i = 0; i < mask.size(); ++i) {
    if (mask[i] != 0) {
      selected.points.push_back(seen.points[i]);
      selected.uv.push_back(seen.uv[i]);
    }
  }
  return selected;
}

int count_inliers(const SeenLandmarks& seen,
                  const Rigid3& camera_from_world,
                  const Camera& camera,
                  double bound_px) {
  int count = 0;
  for (std::size_t i = 0; i < seen.points.size(); ++i) {
    count += is_near(camera_from_world, seen.points[i], seen.uv[i], camera, bound_px) ? 1 : 0;
  }
  return count;
}

std::optional<Localization> optimize_pose(const SeenLandmarks& seen,
                                          const Rigid3& camera_from_world,
                                          const Camera& camera,
                                          const LocalizationOptions& options) {
  const AbsolutePose first = refine_absolute_pose(
      camera_from_world, seen.points, seen.uv, camera,
      {.loss_scale_px = options.first_loss_px, .inlier_bound_px = 2.0 * options.inlier_bound_px});
  if (first.num_inliers < options.min_landmarks) {
    return std::nullopt;
  }
  const SeenLandmarks inliers = select(seen, first.inlier_mask);
  const AbsolutePose second = refine_absolute_pose(
      first.camera_from_world, inliers.points, inliers.uv, camera,
      {.loss_scale_px = options.loss_px, .inlier_bound_px = options.inlier_bound_px});
  if (second.num_inliers < options.min_landmarks) {
    return std::nullopt;
  }
  return Localization{
      second.camera_from_world.inverse(),
      count_inliers(seen, second.camera_from_world, camera, options.inlier_bound_px)};
}

}  // namespace

SeenLandmarks find_seen_landmarks(const Window& window, const TrackPoints& frame) {
  SeenLandmarks seen;
  auto landmark = window.landmarks.begin();
  for (const TrackPoint& point : frame) {
    while (landmark != window.landmarks.end() && landmark->first < point.track_id) {
      ++landmark;
    }
    if (landmark != window.landmarks.end() && landmark->first == point.track_id) {
      seen.points.push_back(landmark->second);
      seen.uv.push_back(point.uv);
    }
  }
  return seen;
}

std::optional<Localization> localize(const SeenLandmarks& seen,
                                     const Rigid3& predicted_world_from_camera,
                                     const Camera& camera,
                                     const LocalizationOptions& options) {
  if (seen.size() < options.min_landmarks) {
    return std::nullopt;
  }
  auto best = optimize_pose(seen, predicted_world_from_camera.inverse(), camera, options);
  const int num_inliers = best.has_value() ? best->num_inliers : 0;
  if (num_inliers >= options.min_agreement * seen.size()) {
    return best;
  }
  const std::optional<Rigid3> start =
      estimate_absolute_pose(seen.points, seen.uv, camera, options.inlier_bound_px, options.seed);
  if (start.has_value()) {
    const auto found = optimize_pose(seen, *start, camera, options);
    if (found.has_value() && found->num_inliers > num_inliers) {
      return found;
    }
  }
  return best;
}

}  // namespace stemvo
