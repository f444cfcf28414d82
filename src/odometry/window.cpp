// SPDX-License-Identifier: MIT
#include "odometry/window.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <numbers>
#include <utility>

#include "geometry/median.hpp"
#include "geometry/triangulation.hpp"
#include "odometry/localization.hpp"

namespace stemvo {
namespace {

/// The oldest keyframe stays while so many landmarks are seen by it and by the one that comes,
/// with more than such a parallax: what lies far off does not connect their positions.
constexpr int kMinConnection = 20;
constexpr double kConnecting_rad = std::numbers::pi / 180.0;
/// The last keyframes, which stay, the coming one among them.
constexpr std::size_t kNumRecent = 4;

bool is_seen_well(const Eigen::Vector3d& point_in_world,
                  std::span<const KeyframeObservation> observations,
                  const std::vector<Rigid3>& poses,
                  const Camera& camera,
                  double bound_px) {
  return std::ranges::all_of(observations, [&](const KeyframeObservation& seen) {
    return is_near(poses[seen.keyframe], point_in_world, seen.uv, camera, bound_px);
  });
}

std::optional<Eigen::Vector3d> triangulate_track(const Window& window,
                                                 std::span<const KeyframeObservation> observations,
                                                 const std::vector<Rigid3>& poses,
                                                 const Camera& camera,
                                                 const WindowOptions& options) {
  if (observations.size() < 2) {
    return std::nullopt;
  }
  const KeyframeObservation& first = observations.front();
  const KeyframeObservation& last = observations.back();
  const Rigid3& world_from_first = window.keyframes[first.keyframe].world_from_camera;
  const TriangulatedPoint point =
      triangulate(poses[last.keyframe] * world_from_first, camera.normalize(first.uv),
                  camera.normalize(last.uv));
  const double max_cos = std::cos(options.min_parallax_deg * std::numbers::pi / 180.0);
  if (!point.finite || !(point.cos_parallax < max_cos)) {
    return std::nullopt;
  }
  const Eigen::Vector3d in_world = world_from_first * point.in_prev;
  return is_seen_well(in_world, observations, poses, camera, options.max_reprojection_error_px)
             ? std::optional(in_world)
             : std::nullopt;
}

/// By fewer landmarks a way is not judged.
constexpr int kMinKnown = 8;

/// For each keyframe whether its way to the newest one is known: the landmarks see it (median)
/// under a larger angle than this. While the camera stands, the least error of its position would
/// make near landmarks of what passes, and these the world's scale.
std::vector<char> have_known_way(const Window& window, double min_way_rad) {
  const Keyframe& newest = window.keyframes.back();
  const SeenLandmarks known = find_seen_landmarks(window, newest.points);
  std::vector<char> have_way;
  for (const Keyframe& keyframe : window.keyframes) {
    std::vector<double> parallaxes;
    std::ranges::transform(known.points, std::back_inserter(parallaxes), [&](const auto& point) {
      return parallax_rad(point, keyframe.world_from_camera, newest.world_from_camera);
    });
    have_way.push_back(known.size() < kMinKnown || median(std::move(parallaxes)) > min_way_rad);
  }
  return have_way;
}

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
        std::ranges::all_of(observations, [&, &at = point](const KeyframeObservation& observation) {
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
  add_landmarks(window, num_fixed_poses, true, read);
  read.bundle.num_fixed_points = static_cast<int>(read.bundle.points.size());
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

std::vector<Rigid3> poses_of(const Window& window) {
  std::vector<Rigid3> poses(window.keyframes.size());
  std::ranges::transform(window.keyframes, poses.begin(), &Rigid3::inverse,
                         &Keyframe::world_from_camera);
  return poses;
}

double parallax_rad(const Eigen::Vector3d& point_in_world,
                    const Rigid3& world_from_a,
                    const Rigid3& world_from_b) {
  const Eigen::Vector3d from_a = point_in_world - world_from_a.translation;
  const Eigen::Vector3d from_b = point_in_world - world_from_b.translation;
  return std::atan2(from_a.cross(from_b).norm(), from_a.dot(from_b));
}

std::size_t leaving_keyframe(const Window& window, const Keyframe& coming) {
  const std::deque<Keyframe>& keyframes = window.keyframes;
  const Keyframe& oldest = keyframes.front();
  const auto connects = [&](const Observation& point) {
    const auto landmark = window.landmarks.find(point.track_id);
    return landmark != window.landmarks.end() &&
           find_point(oldest.points, point.track_id) != nullptr &&
           parallax_rad(landmark->second, oldest.world_from_camera, coming.world_from_camera) >
               kConnecting_rad;
  };
  if (std::ranges::count_if(coming.points, connects) < kMinConnection) {
    return 0;
  }
  const auto position = [&](std::size_t i) -> const Eigen::Vector3d& {
    return keyframes[i].world_from_camera.translation;
  };
  std::size_t leaving = 0;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 1; i + kNumRecent <= keyframes.size(); ++i) {
    const double gap = (position(i + 1) - position(i - 1)).norm();
    const double age = (coming.world_from_camera.translation - position(i)).norm();
    // Gap over age: the further back, the wider the keyframes may stand.
    if (gap < least * age) {
      least = gap / age;
      leaving = i;
    }
  }
  return leaving;
}

std::vector<int> lost_tracks(const Window& window, std::size_t leaving, const Keyframe& coming) {
  std::vector<int> lost;
  ObservationWalk walk(window);
  for (const Observation& point : window.keyframes[leaving].points) {
    if (walk.seek(point.track_id).size() == 1 &&
        find_point(coming.points, point.track_id) == nullptr) {
      lost.push_back(point.track_id);
    }
  }
  return lost;
}

void drop_keyframe(Window& window, std::size_t leaving, const Keyframe& coming) {
  drop_landmarks(window, lost_tracks(window, leaving, coming));
  window.keyframes.erase(window.keyframes.begin() + static_cast<std::ptrdiff_t>(leaving));
}

void triangulate_landmarks(Window& window, const Camera& camera, const WindowOptions& options) {
  const std::vector<Rigid3> poses = poses_of(window);
  const std::vector<char> have_way =
      have_known_way(window, options.min_way_deg * std::numbers::pi / 180.0);
  ObservationWalk walk(window);
  for (const Observation& point : window.keyframes.back().points) {
    if (window.landmarks.contains(point.track_id)) {
      continue;
    }
    const std::span<const KeyframeObservation> seen = walk.seek(point.track_id);
    if (have_way[seen.front().keyframe] == 0) {
      continue;
    }
    if (const auto landmark = triangulate_track(window, seen, poses, camera, options)) {
      window.landmarks.emplace(point.track_id, *landmark);
    }
  }
}

void cull_landmarks(Window& window, const Camera& camera, const WindowOptions& options) {
  const std::vector<Rigid3> poses = poses_of(window);
  ObservationWalk walk(window);
  std::erase_if(window.landmarks, [&](const auto& landmark) {
    const auto& [track_id, point_in_world] = landmark;
    return !is_seen_well(point_in_world, walk.seek(track_id), poses, camera,
                         options.max_reprojection_error_px);
  });
  std::erase_if(window.fixed, [&](int track_id) { return !window.landmarks.contains(track_id); });
}

void drop_landmarks(Window& window, std::span<const int> track_ids) {
  for (const int track_id : track_ids) {
    window.landmarks.erase(track_id);
    window.fixed.erase(track_id);
  }
}

void fix_landmarks(Window& window,
                   const Camera& camera,
                   const std::map<int, Eigen::Vector3d>& known,
                   double bound_px) {
  const std::vector<Rigid3> poses = poses_of(window);
  std::map<int, Eigen::Vector3d> agreeing;
  std::size_t num_seen = 0;
  ObservationWalk walk(window);
  for (const auto& [track_id, point_in_world] : known) {
    const std::span<const KeyframeObservation> observations = walk.seek(track_id);
    num_seen += observations.empty() ? 0 : 1;
    if (!observations.empty() &&
        is_seen_well(point_in_world, observations, poses, camera, bound_px)) {
      agreeing.emplace(track_id, point_in_world);
    }
  }
  if (2 * agreeing.size() < num_seen) {
    return;
  }
  for (const auto& [track_id, point_in_world] : agreeing) {
    window.landmarks[track_id] = point_in_world;
    window.fixed.insert(track_id);
  }
}

void move(Window& window, const Similarity3& moved) {
  for (Keyframe& keyframe : window.keyframes) {
    keyframe.world_from_camera = moved * keyframe.world_from_camera;
  }
  for (auto& [track_id, point] : window.landmarks) {
    point = moved * point;
  }
}

void rescale(Window& window, double factor, const Eigen::Vector3d& center) {
  const auto scaled = [&](const Eigen::Vector3d& point) -> Eigen::Vector3d {
    return center + factor * (point - center);
  };
  for (Keyframe& keyframe : window.keyframes) {
    keyframe.world_from_camera.translation = scaled(keyframe.world_from_camera.translation);
  }
  for (auto& [track_id, point] : window.landmarks) {
    point = scaled(point);
  }
}

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
  const double sigma_px = error_px / kMedianOfRayleigh;
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
