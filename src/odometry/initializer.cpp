// SPDX-License-Identifier: MIT
#include "odometry/initializer.hpp"

#include <algorithm>
#include <utility>

namespace stemvo {
namespace {

/// So many frames can be localized afterwards; earlier ones stay where the reference is.
constexpr std::size_t kMaxWaiting = 300;
constexpr double kMinLiving = 0.5;

}  // namespace

Initializer::Initializer(const Config& config, const Camera& camera)
    : camera_(camera), two_view_(config, camera), seed_(config.seed) {}

void Initializer::start(View reference) {
  reference_ = std::move(reference);
  waiting_.clear();
}

bool Initializer::is_worn_out(const TrackPoints& now) const {
  const auto living = static_cast<double>(common_points(reference_.points, now).size());
  return living < kMinLiving * static_cast<double>(reference_.points.size());
}

MeasuredMotion Initializer::measure(const Matches& matches, const TrackPoints& now) {
  const std::vector<char> all(matches.cur_uv.size(), 1);
  if (matches.prev_frame == reference_.frame) {
    add_begun_points(matches, all, reference_.points);
  }
  const PointPairs pairs = common_points(reference_.points, now);
  MeasuredMotion motion =
      two_view_.measure(pairs.prev_uv, pairs.cur_uv, /*is_initializing=*/true, seed_);
  std::vector<char> mask = all;
  for (std::size_t i = 0; i < mask.size(); ++i) {
    const auto pair = std::lower_bound(pairs.track_ids.begin(), pairs.track_ids.end(),
                                       matches.track_ids[i]);
    if (pair != pairs.track_ids.end() && *pair == matches.track_ids[i]) {
      mask[i] = motion.inlier_mask[static_cast<std::size_t>(pair - pairs.track_ids.begin())];
    }
  }
  motion.inlier_mask = std::move(mask);
  return motion;
}

std::optional<Window> Initializer::open_window(const View& now,
                                               const WindowOptions& window_options,
                                               const LocalizationOptions& localization) const {
  Window window;
  add_keyframe(window, {reference_.frame, reference_.world_from_camera, reference_.points, {}},
               window_options);
  add_keyframe(window, {now.frame, now.world_from_camera, now.points, {}}, window_options);
  triangulate_landmarks(window, camera_, window_options);
  if (static_cast<int>(window.landmarks.size()) < localization.min_landmarks) {
    return std::nullopt;
  }
  Rigid3 predicted = reference_.world_from_camera;
  for (const View& view : waiting_) {
    const auto found =
        localize(find_seen_landmarks(window, view.points), predicted, camera_, localization);
    if (found.has_value()) {
      predicted = found->world_from_camera;
    }
    window.keyframes.front().followers.push_back(
        {view.frame, reference_.world_from_camera.inverse() * predicted});
  }
  return window;
}

void Initializer::wait(View view) {
  if (waiting_.size() < kMaxWaiting) {
    waiting_.push_back(std::move(view));
  }
}

}  // namespace stemvo
