// SPDX-License-Identifier: MIT
#include "odometry/map_tracker.hpp"

#include <algorithm>
#include <utility>

#include "odometry/landmarks.hpp"

namespace stemvo {
namespace {

/// Of the step (and in rad): far above rounding, far below any measurement.
constexpr double kSamePose = 1e-5;

}  // namespace

MapTracker::MapTracker(const Camera& camera, const MapTrackerOptions& options)
    : camera_(camera), options_(options), last_step_(options.first_step) {}

void MapTracker::restart(int frame) {
  start_anew(/*is_last_pose_kept=*/true);
  frame_ = frame;
}

void MapTracker::start_anew(bool is_last_pose_kept) {
  if (!is_last_pose_kept && !map_.keyframes.empty() && map_.keyframes.back().frame == frame_) {
    map_.keyframes.pop_back();
  }
  history_.close(map_);
  map_.clear();
}

void MapTracker::look(const cv::Mat& picture) {
  if (!map_.keyframes.empty() && map_.keyframes.back().frame == frame_) {
    history_.look(map_, picture);
  }
}

MapHistory MapTracker::history() const {
  MapHistory history = history_;
  history.close(map_);
  return history;
}

bool MapTracker::place(int frame,
                       const Rigid3& world_from_prev,
                       const Matches& matches,
                       MeasuredMotion& motion) {
  // The caller chains relative motions: the same pose but for rounding.
  const Rigid3 moved = world_from_camera_.inverse() * world_from_prev;
  const bool is_where_we_left =
      moved.translation.norm() < kSamePose * last_step_ && moved.angle_rad() < kSamePose;
  keeps_unit_ = is_where_we_left || map_.keyframes.empty();
  if (!is_where_we_left) {
    start_anew(/*is_last_pose_kept=*/false);
    world_from_camera_ = world_from_prev;
  }
  const std::optional<Rigid3> placed = place_by_landmarks(matches, motion);
  if (!placed.has_value() && !is_believable(matches, motion)) {
    motion.state = FrameState::kLost;
    motion.cur_from_prev = {};
    return false;
  }
  const bool has_landmarks =
      static_cast<int>(map_.landmarks.size()) >= options_.placement.min_landmarks;
  if (!placed.has_value() && motion.state == FrameState::kTracking && has_landmarks) {
    start_anew(/*is_last_pose_kept=*/true);  // they are elsewhere, or wrong
    keeps_unit_ = false;
  }
  if (options_.use_landmarks && map_.keyframes.empty()) {
    open_map(matches, motion.inlier_mask);
  }
  frame_ = frame;
  world_from_camera_ = placed.value_or(guess_pose(motion));
  const double step = (world_from_camera_.translation - world_from_prev.translation).norm();
  if (motion.state == FrameState::kTracking && step > 0.0) {
    last_step_ = step;
  }
  return true;
}

void MapTracker::add_to_window(Keyframe keyframe) {
  if (static_cast<int>(map_.keyframes.size()) >= options_.map.num_keyframes) {
    std::sort(keyframe.observations.begin(), keyframe.observations.end(),
              [](const auto& a, const auto& b) { return a.track_id < b.track_id; });
    history_.leave(map_, keyframe);
  }
  add_keyframe(map_, std::move(keyframe), options_.map);
}

/// The frame before the first one given saw the same tracks.
void MapTracker::open_map(const Matches& matches, const std::vector<char>& is_inlier) {
  Keyframe first{frame_, world_from_camera_, {}};
  for (std::size_t i = 0; i < matches.prev_uv.size(); ++i) {
    if (is_inlier[i] != 0) {
      first.observations.push_back({matches.track_ids[i], matches.prev_uv[i]});
    }
  }
  add_to_window(std::move(first));
}

Rigid3 MapTracker::guess_pose(const MeasuredMotion& motion) const {
  const Rigid3 prev_from_cur = motion.cur_from_prev.inverse();
  // Slow frames show their direction badly and their length not at all: landmarks tell both.
  const double step = motion.state == FrameState::kTracking ? last_step_ : 0.0;
  return world_from_camera_ * Rigid3(prev_from_cur.rotation, step * prev_from_cur.translation);
}

std::optional<Rigid3> MapTracker::place_by_landmarks(const Matches& matches,
                                                     MeasuredMotion& motion) const {
  if (motion.state == FrameState::kStanding || motion.state == FrameState::kRotating) {
    return guess_pose(motion);
  }
  const SeenLandmarks seen = find_seen_landmarks(map_, matches, motion.inlier_mask);
  std::optional<Placement> placement =
      place_from_guess(seen, guess_pose(motion), camera_, options_.placement);
  const int num_agreeing = placement.has_value() ? placement->num_agreeing : 0;
  if (num_agreeing < options_.placement.min_agreement * seen.size()) {
    const auto found = place_by_search(seen, camera_, options_.placement);
    if (found.has_value() && found->num_agreeing > num_agreeing) {
      placement = found;
      correct_motion(found->world_from_camera, matches, motion);
    }
  }
  if (!placement.has_value()) {
    return std::nullopt;
  }
  if (!is_agreed_on(matches, motion)) {
    correct_motion(placement->world_from_camera, matches, motion);
  }
  return placement->world_from_camera;
}

void MapTracker::correct_motion(const Rigid3& world_from_camera,
                                const Matches& matches,
                                MeasuredMotion& motion) const {
  const Rigid3 cur_from_prev = world_from_camera.inverse() * world_from_camera_;
  const double step = cur_from_prev.translation.norm();
  if (!(step > 0.0)) {
    return;
  }
  motion.state = motion.state == FrameState::kLost ? FrameState::kTracking : motion.state;
  motion.cur_from_prev = Rigid3(cur_from_prev.rotation, cur_from_prev.translation / step);
  motion.inlier_mask = epipolar_inliers(motion.cur_from_prev, matches.prev_uv, matches.cur_uv,
                                        camera_, options_.epipolar_bound_px);
  motion.num_inliers =
      static_cast<int>(std::count(motion.inlier_mask.begin(), motion.inlier_mask.end(), char{1}));
}

bool MapTracker::is_agreed_on(const Matches& matches, const MeasuredMotion& motion) const {
  return motion.num_inliers >=
         options_.placement.min_agreement * static_cast<double>(matches.cur_uv.size());
}

/// A two-frame motion that the landmarks do not confirm. Where they are out of view it must do;
/// where they are in view (a cut: tracks that end up anywhere) most matches must agree with it.
bool MapTracker::is_believable(const Matches& matches, const MeasuredMotion& motion) const {
  if (motion.state == FrameState::kLost) {
    return false;
  }
  const SeenLandmarks seen = find_seen_landmarks(map_, matches, motion.inlier_mask);
  return seen.size() < options_.placement.min_landmarks || is_agreed_on(matches, motion);
}

/// Frames without parallax to the one before tell nothing of depth.
bool MapTracker::is_new_keyframe(const MeasuredMotion& motion) const {
  return options_.use_landmarks && motion.state == FrameState::kTracking;
}

void MapTracker::extend(const Matches& matches, const MeasuredMotion& motion) {
  if (!is_new_keyframe(motion)) {
    return;
  }
  Keyframe keyframe{frame_, world_from_camera_, {}};
  for (std::size_t i = 0; i < matches.cur_uv.size(); ++i) {
    if (motion.inlier_mask[i] != 0) {
      keyframe.observations.push_back({matches.track_ids[i], matches.cur_uv[i]});
    }
  }
  add_to_window(std::move(keyframe));
  triangulate_landmarks(map_, camera_, options_.map);
  ++keyframes_since_refinement_;
  if (options_.refine_every > 0 && keyframes_since_refinement_ >= options_.refine_every) {
    keyframes_since_refinement_ = 0;
    refine_window(map_, camera_, options_.refinement);
    world_from_camera_ = map_.keyframes.back().world_from_camera;
  }
  cull_landmarks(map_, camera_, options_.map);
}

void MapTracker::rescale(double factor, const Eigen::Vector3d& center) {
  const auto scaled = [&](const Eigen::Vector3d& point) -> Eigen::Vector3d {
    return center + factor * (point - center);
  };
  for (Keyframe& keyframe : map_.keyframes) {
    keyframe.world_from_camera.translation = scaled(keyframe.world_from_camera.translation);
  }
  for (auto& [track_id, point] : map_.landmarks) {
    point = scaled(point);
  }
  world_from_camera_.translation = scaled(world_from_camera_.translation);
  last_step_ *= factor;
}

}  // namespace stemvo
