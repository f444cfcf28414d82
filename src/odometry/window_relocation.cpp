// SPDX-License-Identifier: MIT
#include <utility>
#include <vector>

#include "odometry/tracks.hpp"
#include "odometry/window_estimator.hpp"

namespace stemvo {

// The map that remembers changes the window here.

namespace {

/// A landmark is not put where a keyframe would see it farther off: the path has no jumps.
constexpr double kMaxPull_px = 2.0;

}  // namespace

bool WindowEstimator::relocate(const Frame& frame,
                               const Observations& now,
                               const Rigid3& predicted) {
  if (frame.pyramid == nullptr) {
    return false;
  }
  const std::optional<Relocation> found =
      mapper_.locate(window_view(), frame.matches, *frame.pyramid, predicted);
  if (!found.has_value()) {
    return false;
  }
  recognized_frame_ = found->frame;
  mapper_.close(window_view());
  mapper_.begin_at_relocation();
  history_.close(window_);
  map_ids_.go_back_to(found->frame);
  window_ = {};
  window_.keyframes.push_back({frame.number, found->world_from_camera, now});
  fix_landmarks(window_, camera(), found->landmarks, window_options_.max_reprojection_error_px);
  scale_.restart(frame.road.get(), frame.time_s, true);
  calibration_.restart();
  world_from_camera_ = found->world_from_camera;
  road_pose_ = world_from_camera_;
  motion_.restart();
  is_last_localized_ = false;
  return true;
}

void WindowEstimator::take_in(const Recognition& recognition) {
  if (recognition.frame == -1) {
    return;
  }
  recognized_frame_ = recognition.frame;
  if (recognition.moved.has_value()) {
    const Similarity3& moved = *recognition.moved;
    move(window_, moved);
    history_.rescale(moved.scale);
    calibration_.restart();
    for (Rigid3* pose :
         {&world_from_camera_, &view_.world_from_camera, &last_.world_from_camera, &road_pose_}) {
      *pose = moved * *pose;
    }
    moved_to_ = moved * moved_to_;
    motion_.rescale(moved.scale);
    speed_ *= moved.scale;
    moved_ = moved;
    map_ids_.join(recognition.frame);
  }
  fix_landmarks(window_, camera(), recognition.landmarks, kMaxPull_px);
}

}  // namespace stemvo
