// SPDX-License-Identifier: MIT
#include "odometry/tracks.hpp"
#include "odometry/window_estimator.hpp"

namespace stemvo {

// Tracks that the pose does not explain.

namespace {

/// A track this near moves as the world does, where a thing is the other choice.
constexpr double kAgrees_px = 1.0;

}  // namespace

void WindowEstimator::mark_outliers(const Matches& matches,
                                    double bound_px,
                                    std::vector<char>& mask) const {
  const Rigid3 camera_from_world = world_from_camera_.inverse();
  if (is_last_localized_ && matches.prev_frame == last_.frame) {
    mask = epipolar_inliers(camera_from_world * last_.world_from_camera,
                            {matches.prev_uv, matches.cur_uv}, camera(), bound_px);
  }
  for (std::size_t i = 0; i < mask.size(); ++i) {
    const auto landmark = window_.landmarks.find(matches.track_ids[i]);
    if (landmark != window_.landmarks.end()) {
      mask[i] = is_near(camera_from_world, landmark->second, matches.cur_uv[i], camera(), bound_px);
    }
  }
}

void WindowEstimator::follow_things(const Matches& matches, LocalizedFrame& localized) {
  if (moving_.empty()) {
    return;
  }
  std::vector<char> fits_world(matches.cur_uv.size(), 1);
  mark_outliers(matches, kAgrees_px, fits_world);
  moving_.observe(matches, fits_world);
  localized.moving_mask = moving_.flags(matches);
  moving_.leave_out(matches, localized.inlier_mask);
}

}  // namespace stemvo
