// SPDX-License-Identifier: MIT
#include "odometry/bundle_adjustment.hpp"

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <span>
#include <utility>
#include <vector>

#include "geometry/median.hpp"

namespace stemvo {
namespace {

/// Nearer, or behind: no start for the solver; map units.
constexpr double kMinDepth = 1e-6;
/// Fewer observations of a landmark hold it nowhere.
constexpr std::size_t kMinObservations = 2;
/// Least Cauchy scale over the median error: a lens or a shutter that the camera model does not
/// know makes every observation worse.
constexpr double kLossShare = 2.0;

/// The part of a window that is refined.
struct WindowBundle {
  Bundle bundle;
  std::vector<int> track_ids;  ///< of its points
};

/// Adds the landmarks that are fixed, or the others. One that is fixed holds a pose by a single
/// observation.
void add_landmarks(const Window& window, int num_fixed_poses, bool are_fixed, WindowBundle& read) {
  Bundle& bundle = read.bundle;
  const std::size_t min_observations = are_fixed ? 1 : kMinObservations;
  ObservationWalk walk(window);
  for (const auto& [track_id, point] : window.landmarks) {
    if (window.fixed.contains(track_id) != are_fixed) {
      continue;
    }
    const std::span<const KeyframeObservation> observations = walk.seek(track_id);
    const bool is_in_front =
        std::all_of(observations.begin(), observations.end(),
                    [&, &at = point](const KeyframeObservation& observation) {
                      return (bundle.camera_from_world[observation.keyframe] * at).z() > kMinDepth;
                    });
    const bool moves_a_pose =
        !observations.empty() && static_cast<int>(observations.back().keyframe) >= num_fixed_poses;
    if (observations.size() < min_observations || !is_in_front || !moves_a_pose) {
      continue;
    }
    for (const KeyframeObservation& observation : observations) {
      bundle.observations.push_back({static_cast<int>(observation.keyframe),
                                     static_cast<int>(bundle.points.size()), observation.uv});
    }
    bundle.points.push_back(point);
    read.track_ids.push_back(track_id);
  }
}

WindowBundle read_window(const Window& window, const Camera& camera, int num_fixed_poses) {
  WindowBundle read;
  read.bundle.camera = camera;
  read.bundle.camera_from_world = poses_of(window);
  if (!window.fixed.empty()) {
    add_landmarks(window, num_fixed_poses, true, read);
    read.bundle.num_fixed_points = static_cast<int>(read.bundle.points.size());
  }
  add_landmarks(window, num_fixed_poses, false, read);
  return read;
}

/// Reprojection error before the solve, the newest keyframe's included.
double median_error_px(const Bundle& bundle) {
  std::vector<double> errors;
  errors.reserve(bundle.observations.size());
  for (const Bundle::Observation& observation : bundle.observations) {
    const Eigen::Vector3d x = bundle.camera_from_world[static_cast<std::size_t>(observation.pose)] *
                              bundle.points[static_cast<std::size_t>(observation.point)];
    errors.push_back((bundle.camera.project(x) - observation.uv).norm());
  }
  return median(std::move(errors));
}

/// From the oldest keyframe to the last but one.
double length_of(const Window& window) {
  const Keyframe& last_but_one = *std::next(window.keyframes.rbegin());
  return (last_but_one.world_from_camera.translation -
          window.keyframes.front().world_from_camera.translation)
      .norm();
}

void write_back(const WindowBundle& refined, Window& window, int num_fixed) {
  for (std::size_t i = static_cast<std::size_t>(num_fixed); i < window.keyframes.size(); ++i) {
    window.keyframes[i].world_from_camera = refined.bundle.camera_from_world[i].inverse();
  }
  for (std::size_t i = 0; i < refined.track_ids.size(); ++i) {
    window.landmarks[refined.track_ids[i]] = refined.bundle.points[i];
  }
}

}  // namespace

bool refine_window(Window& window, const Camera& camera, const BundleOptions& options) {
  if (static_cast<int>(window.keyframes.size()) <= options.num_fixed_poses) {
    return false;
  }
  WindowBundle read = read_window(window, camera, options.num_fixed_poses);
  BundleOptions solver = options;
  solver.loss_scale_px = std::max(options.loss_scale_px, kLossShare * median_error_px(read.bundle));
  if (!solve_bundle_adjustment(read.bundle, solver).is_usable) {
    return false;
  }
  const double length = length_of(window);
  write_back(read, window, options.num_fixed_poses);
  const double refined_length = length_of(window);
  const bool is_scale_free = options.num_fixed_poses < 2 && read.bundle.num_fixed_points == 0;
  if (is_scale_free && length > 0.0 && refined_length > 0.0) {
    rescale(window, length / refined_length,
            window.keyframes.front().world_from_camera.translation);
  }
  return true;
}

std::optional<CameraMeasurement> measure_camera(const Window& window,
                                                const Camera& camera,
                                                const CameraPrior& prior,
                                                const BundleOptions& options) {
  BundleOptions solver = options;
  solver.num_fixed_poses = 1;
  WindowBundle read = read_window(window, camera, solver.num_fixed_poses);
  const double error_px = median_error_px(read.bundle);
  // Lengths of noise with equal sigmas in u and v have Rayleigh's distribution, median 1.1774
  // sigma.
  const double sigma_px = error_px / 1.1774;
  solver.max_iterations = 30;  // to the end: what is left of the way there is left of the error
  solver.min_relative_decrease = 1e-4;
  solver.camera = CameraPrior{prior.mean, prior.information * (sigma_px * sigma_px)};
  solver.loss_scale_px = std::max(options.loss_scale_px, kLossShare * error_px);
  const BundleResult result = solve_bundle_adjustment(read.bundle, solver);
  if (!result.is_usable) {
    return std::nullopt;
  }
  return CameraMeasurement{result.camera_change, result.information / (sigma_px * sigma_px)};
}

}  // namespace stemvo
