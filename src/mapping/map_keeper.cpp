// SPDX-License-Identifier: MIT
#include "mapping/map_keeper.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "geometry/median.hpp"
#include "geometry/pose_influence.hpp"
#include "odometry/localization.hpp"

namespace stemvo {
namespace {

/// Both in the order of their tracks.
void take_landmarks(const std::vector<KeptCorner>& from, std::vector<KeptCorner>& to) {
  for (KeptCorner& corner : to) {
    const auto same = std::ranges::lower_bound(from, corner.track_id, {}, &KeptCorner::track_id);
    if (same != from.end() && same->track_id == corner.track_id) {
      corner.in_camera = same->in_camera;
    }
  }
}

/// Errors of a track's points are alike: so many times the sigmas of independent ones.
constexpr double kAlikeFactor = 3.0;
/// Standard deviations of a motion between two keyframes: what a camera bends besides the noise of
/// tracks. Rotation, share of the depth, scale.
constexpr double kMotionSigma_rad = 5e-4;
constexpr double kMotionSigma = 2e-3;
constexpr double kMotionLogScale = 6e-3;
/// A guess's standard deviations of the rotation, and of log(scale).
constexpr double kGuess_rad = 1.0;
constexpr double kGuessLogScale = 1.0;

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

/// The motion from `from`, which is this node, to `to`, the next one, with its sigmas; each
/// keyframe has its own unit.
MapEdge motion_between(const WindowView& view, const Keyframe& from, const Keyframe& to, int node) {
  const double units_of_from = view.history.units(from.frame);
  const double units_of_to = view.history.units(to.frame);
  const Rigid3 from_to = from.world_from_camera.inverse() * to.world_from_camera;
  MapEdge edge{.from = node,
               .to = node + 1,
               .from_to = {units_of_from / units_of_to, from_to.rotation,
                           units_of_from * from_to.translation}};
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
  const double noise_px = errors.empty() ? 1.0 : median(std::move(errors)) / kMedianOfRayleigh;
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

/// The guess that connects the first keyframe of a new map with the last one of the map before.
MapEdge guessed_motion(const KeptKeyframe& from, const KeptKeyframe& to, int node) {
  const Rigid3 from_to = from.world_from_camera.inverse() * to.world_from_camera;
  return {node,
          node + 1,
          Similarity3(from_to),
          kGuess_rad,
          std::max(1.0, from_to.translation.norm()),
          kGuessLogScale};
}

}  // namespace

std::vector<KeptCorner> corners_of(const WindowView& view, const Keyframe& keyframe) {
  const double units = view.history.units(keyframe.frame);
  const Rigid3 camera_from_world = keyframe.world_from_camera.inverse();
  std::vector<KeptCorner> corners;
  for (const Observation& point : keyframe.points) {
    KeptCorner& corner = corners.emplace_back();
    corner.track_id = point.track_id;
    corner.uv = point.uv.cast<float>();
    const auto landmark = view.window.landmarks.find(point.track_id);
    if (landmark != view.window.landmarks.end()) {
      corner.in_camera = (units * (camera_from_world * landmark->second)).cast<float>();
    }
  }
  return corners;
}

void MapKeeper::load(KeptMap map) {
  constexpr int kNone = -1;  // no frame's number, nor a track's
  constexpr double kPause_s = 3600.0;
  map_ = std::move(map);
  components_.assign(map_.keyframes.size(), 0);
  if (map_.keyframes.empty()) {
    return;
  }
  find_components();
  int last_track = std::numeric_limits<int>::min();
  for (const KeptKeyframe& keyframe : map_.keyframes) {
    last_track = keyframe.corners.empty() ? last_track
                                          : std::max(last_track, keyframe.corners.back().track_id);
  }
  const int last_frame = map_.keyframes.back().frame;
  const double last_time_s = map_.keyframes.back().time_s;
  for (KeptKeyframe& keyframe : map_.keyframes) {
    keyframe.frame += kNone - 1 - last_frame;
    keyframe.time_s -= last_time_s + kPause_s;
    for (KeptCorner& corner : keyframe.corners) {
      corner.track_id += kNone - 1 - last_track;
    }
  }
}

/// Keyframes that measurements connect.
void MapKeeper::find_components() {
  std::iota(components_.begin(), components_.end(), 0);
  const auto join = [&](const MapEdge& edge) {
    const auto [low, high] = std::minmax({component_of(edge.from), component_of(edge.to)});
    if (!edge.is_guess() && low != high) {
      std::ranges::replace(components_, high, low);
    }
  };
  std::ranges::for_each(map_.motions, join);
  std::ranges::for_each(map_.loops, join);
  num_components_ = static_cast<int>(components_.size());
}

void MapKeeper::add_node(const WindowView& view, const Keyframe& keyframe) {
  const auto frame = static_cast<std::size_t>(keyframe.frame);
  KeptKeyframe kept;
  kept.frame = keyframe.frame;
  kept.time_s = view.times_s[frame];
  kept.camera = view.camera;
  kept.radial = view.radials[frame];
  kept.world_from_camera = view.trajectory[frame];
  const int node = static_cast<int>(map_.keyframes.size());
  if (nodes_.empty() && node > 0 && map_.keyframes.back().frame == keyframe.frame) {
    reopen_last(keyframe);
    return;
  }
  if (nodes_.empty()) {
    connect_first(kept);
  }
  if (view.metric_sigma.has_value()) {
    const double units_of_metre = view.history.units(keyframe.frame);
    map_.lengths.push_back({node, -std::log(units_of_metre), *view.metric_sigma});
  }
  nodes_[keyframe.frame] = node;
  components_.push_back(component_);
  map_.map_from_keyframe.push_back(map_from_world_ * Similarity3(kept.world_from_camera));
  map_.keyframes.push_back(std::move(kept));
}

/// The first keyframe of a window.
void MapKeeper::connect_first(KeptKeyframe& kept) {
  const int node = static_cast<int>(map_.keyframes.size());
  if (relocation_.has_value()) {
    component_ = component_of(relocation_->from);
    relocation_->to = node;
    map_.loops.push_back(*relocation_);
    relocation_.reset();
    return;
  }
  if (node == 0) {
    component_ = num_components_++;
    return;
  }
  MapEdge edge = guessed_motion(map_.keyframes.back(), kept, node - 1);
  if (kept.frame <= last_localized_ && !map_.motions.empty()) {
    // Both frames saw the window before: the motion is as well known as the last one was.
    edge.sigma_rad = map_.motions.back().sigma_rad;
    edge.sigma_translation = map_.motions.back().sigma_translation;
  } else {
    component_ = num_components_++;
  }
  map_.motions.push_back(edge);
}

/// The last node has a new unit: landmarks and lengths in its old one count no more.
void MapKeeper::reopen_last(const Keyframe& keyframe) {
  const int node = static_cast<int>(map_.keyframes.size()) - 1;
  nodes_[keyframe.frame] = node;
  for (MapEdge& motion : map_.motions) {
    if (motion.to == node) {
      motion.sigma_log_scale = kGuessLogScale;
    }
  }
  std::erase_if(map_.lengths, [&](const MapLength& length) { return length.keyframe == node; });
  std::vector<KeptCorner>& corners = map_.keyframes.back().corners;
  for (KeptCorner& corner : corners) {
    corner.in_camera.setConstant(std::numeric_limits<float>::quiet_NaN());
  }
  const bool is_place =
      !map_.keyframes.back().descriptors.empty() ||
      std::ranges::any_of(map_.loops, [&](const Loop& loop) { return loop.to == node; });
  if (is_place) {
    return;  // loops count its corners
  }
  for (const Observation& point : keyframe.points) {
    if (std::ranges::find(corners, point.track_id, &KeptCorner::track_id) == corners.end()) {
      corners.push_back({point.track_id, point.uv.cast<float>()});
    }
  }
  std::ranges::sort(corners, {}, &KeptCorner::track_id);
}

std::optional<Similarity3> MapKeeper::add_loop(const Loop& loop) {
  map_.loops.push_back(loop);
  const auto [older, younger] = std::minmax({component_of(loop.from), component_of(loop.to)});
  if (older == younger) {
    return std::nullopt;
  }
  // The guess between them counts no more.
  std::erase_if(map_.motions, [&, younger = younger](const MapEdge& edge) {
    return edge.is_guess() && component_of(edge.from) < younger && component_of(edge.to) == younger;
  });
  Similarity3 moved = map_.pose(loop.from) * loop.from_to * map_.pose(loop.to).inverse();
  if (component_of(loop.from) == younger) {
    moved = moved.inverse();
  }
  const bool comes_to_world = !has_own(older);
  for (std::size_t i = 0; i < components_.size(); ++i) {
    if (components_[i] == younger) {
      components_[i] = older;
      map_.map_from_keyframe[i] = moved * map_.map_from_keyframe[i];
    }
  }
  if (component_ != younger) {
    return std::nullopt;
  }
  component_ = older;
  if (comes_to_world) {
    map_from_world_ = moved * map_from_world_;
    return std::nullopt;
  }
  return map_from_world_.inverse() * moved * map_from_world_;
}

KeptMap MapKeeper::graph(const WindowView& view) const {
  KeptMap graph;
  for (const KeptKeyframe& keyframe : map_.keyframes) {
    graph.keyframes.emplace_back().time_s = keyframe.time_s;
  }
  graph.map_from_keyframe = map_.map_from_keyframe;
  graph.motions = map_.motions;
  for (const Loop& loop : map_.loops) {
    graph.loops.push_back({static_cast<const MapEdge&>(loop), {}});
  }
  graph.lengths = map_.lengths;
  const auto& keyframes = view.window.keyframes;
  for (std::size_t i = 1; i < keyframes.size(); ++i) {
    const int node = node_of(keyframes[i].frame);
    if (node > 0 && node == node_of(keyframes[i - 1].frame) + 1) {
      graph.motions.push_back(motion_between(view, keyframes[i - 1], keyframes[i], node - 1));
    }
  }
  return graph;
}

void MapKeeper::apply(std::span<const Similarity3> solved) {
  const Similarity3 moved = solved.back() * map_.map_from_keyframe[solved.size() - 1].inverse();
  std::ranges::copy(solved, map_.map_from_keyframe.begin());
  for (std::size_t i = solved.size(); i < map_.map_from_keyframe.size(); ++i) {
    map_.map_from_keyframe[i] = moved * map_.map_from_keyframe[i];
  }
  map_from_world_ = moved * map_from_world_;
}

std::vector<int> MapKeeper::merge() {
  const int end = nodes_.empty() ? static_cast<int>(map_.keyframes.size()) : nodes_.begin()->second;
  std::vector<int> numbers = merge_known_terrain(map_, end);
  if (numbers.empty()) {
    return numbers;
  }
  for (auto& [frame, node] : nodes_) {
    node = numbers[slot(node)];
  }
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    if (numbers[i] >= 0) {
      components_[static_cast<std::size_t>(numbers[i])] = components_[i];
    }
  }
  components_.resize(map_.keyframes.size());
  return numbers;
}

void MapKeeper::leave(const WindowView& view, std::size_t leaving) {
  const Keyframe& keyframe = view.window.keyframes[leaving];
  const int node = node_of(keyframe.frame);
  if (node < 0) {
    return;
  }
  // A place stays what it was when it was described; its landmarks are known better now.
  std::vector<KeptCorner> corners = corners_of(view, keyframe);
  std::vector<KeptCorner>& kept = this->keyframe(node).corners;
  if (kept.empty()) {
    kept = std::move(corners);
  } else {
    take_landmarks(corners, kept);
  }
  // The motions to the nodes before and after, where those are in the window still.
  for (const Keyframe& other : view.window.keyframes) {
    const int neighbour = node_of(other.frame);
    if (neighbour >= 0 && neighbour == node - 1) {
      map_.motions.push_back(motion_between(view, other, keyframe, neighbour));
    } else if (neighbour == node + 1) {
      map_.motions.push_back(motion_between(view, keyframe, other, node));
    }
  }
  nodes_.erase(keyframe.frame);
}

}  // namespace stemvo
