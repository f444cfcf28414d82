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

void MapTracker::add(int frame,
                     const Rigid3& world_from_prev,
                     const Matches& matches,
                     const MeasuredMotion& motion) {
  // The caller chains relative motions: the same pose but for rounding.
  const Rigid3 moved = world_from_camera_.inverse() * world_from_prev;
  const bool is_where_we_left =
      moved.translation.norm() < kSamePose * last_step_ && moved.angle_rad() < kSamePose;
  if (!is_where_we_left) {
    start_anew(/*is_last_pose_kept=*/false);
    world_from_camera_ = world_from_prev;
  }
  if (map_.keyframes.empty()) {
    open_map(matches, motion.inlier_mask);
  }
  frame_ = frame;
  world_from_camera_ = place(matches, motion);
  const double step = (world_from_camera_.translation - world_from_prev.translation).norm();
  // Standing still and turning on the spot leave a step of rounding errors, which is no length.
  const bool has_moved = motion.cur_from_prev.translation.norm() > 0.0;
  last_step_ = has_moved && step > 0.0 ? step : last_step_;
  if (is_new_keyframe(motion)) {
    extend_map(matches, motion.inlier_mask);
  }
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

Rigid3 MapTracker::place(const Matches& matches, const MeasuredMotion& motion) {
  const Rigid3 prev_from_cur = motion.cur_from_prev.inverse();
  const Rigid3 guess =
      world_from_camera_ * Rigid3(prev_from_cur.rotation, last_step_ * prev_from_cur.translation);
  if (!(prev_from_cur.translation.norm() > 0.0)) {
    return guess;
  }
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector2d> uv;
  for (std::size_t i = 0; i < matches.cur_uv.size(); ++i) {
    const auto landmark = map_.landmarks.find(matches.track_ids[i]);
    if (motion.inlier_mask[i] != 0 && landmark != map_.landmarks.end()) {
      points.push_back(landmark->second);
      uv.push_back(matches.cur_uv[i]);
    }
  }
  if (static_cast<int>(points.size()) < options_.min_landmarks) {
    return guess;
  }
  const AbsolutePose pose =
      refine_absolute_pose(guess.inverse(), points, uv, camera_, options_.pose);
  return pose.num_inliers >= options_.min_landmarks ? pose.camera_from_world.inverse() : guess;
}

/// Frames without parallax to the one before tell nothing of depth.
bool MapTracker::is_new_keyframe(const MeasuredMotion& motion) const {
  return motion.state == FrameState::kTracking;
}

void MapTracker::extend_map(const Matches& matches, const std::vector<char>& is_inlier) {
  Keyframe keyframe{frame_, world_from_camera_, {}};
  for (std::size_t i = 0; i < matches.cur_uv.size(); ++i) {
    if (is_inlier[i] != 0) {
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
