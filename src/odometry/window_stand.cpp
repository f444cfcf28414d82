// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "odometry/tracks.hpp"
#include "odometry/window_estimator.hpp"

namespace stemvo {

// Cars that pass a camera that stands hide its landmarks. When it moves off, hundreds of tracks
// begun meanwhile tell how it moves; the few landmarks that are left tell how far.

namespace {

/// The stand's keyframe is what a frame without a pose is measured against, where so many landmarks
/// and tracks of it are left.
constexpr int kMinLandmarks = 4;
constexpr std::size_t kMinTracks = 50;
/// Landmarks tell a length by so many pixels of parallax (root of their squares' sum): with errors
/// of 0.3 px, to 3 %.
constexpr double kTelling_px = 10.0;

/// A landmark's word on the way between two frames.
struct ToldLength {
  double length;       ///< puts the landmark nearest to where it is seen
  double px_per_unit;  ///< moves the landmark
};

std::vector<ToldLength> measure_lengths(const SeenLandmarks& seen,
                                        const Rigid3& reference_from_world,
                                        const Rigid3& cur_from_reference,
                                        const Camera& camera) {
  std::vector<ToldLength> lengths;
  for (std::size_t i = 0; i < seen.points.size(); ++i) {
    const Eigen::Vector3d turned =
        cur_from_reference.rotation * (reference_from_world * seen.points[i]);
    // ray x (turned + length * translation) = 0, by least squares.
    const Eigen::Vector3d ray = camera.normalize(seen.uv[i]).homogeneous();
    const Eigen::Vector3d along = ray.cross(cur_from_reference.translation);
    const double px = camera.mean_focal_px() * along.norm() / turned.z();
    if (turned.z() > 0.0 && px > 0.0) {
      lengths.push_back({-ray.cross(turned).dot(along) / along.squaredNorm(), px});
    }
  }
  return lengths;
}

/// The median, weighted by the pixels. nullopt: too few landmarks, or too little parallax.
std::optional<double> most_likely(std::vector<ToldLength> lengths) {
  if (std::ssize(lengths) < kMinLandmarks) {
    return std::nullopt;
  }
  double sum = 0.0;
  double squares = 0.0;
  for (const ToldLength& told : lengths) {
    sum += told.px_per_unit;
    squares += told.px_per_unit * told.px_per_unit;
  }
  std::ranges::sort(lengths, {}, &ToldLength::length);
  double left = 0.5 * sum;
  const auto middle = std::ranges::find_if(lengths, [&](const ToldLength& told) {
    left -= told.px_per_unit;
    return left <= 0.0;
  });
  return middle->length * std::sqrt(squares) > kTelling_px ? std::optional(middle->length)
                                                           : std::nullopt;
}

}  // namespace

/// Null: no keyframe is of the stand.
const Keyframe* WindowEstimator::stand_keyframe() const {
  const auto stood = std::ranges::find(window_.keyframes, stand_.frame, &Keyframe::frame);
  return stood != window_.keyframes.end() ? &*stood : nullptr;
}

/// Who passes has hidden what was seen when the stand began: what was seen last takes its place.
void WindowEstimator::renew_stand(const Observations& now) {
  if (stood_ && !stand_.points.empty() &&
      std::ssize(common_points(moving_view_.points, now).cur_uv) < options_.min_inliers) {
    moving_view_.points = stand_.points;
  }
}

/// What hides the world hides the stand's tracks one after the other: those that began meanwhile
/// join them. The others are compared with where they were, for a camera that creeps off.
void WindowEstimator::renew_stand_behind(const Frame& frame, const Observations& now) {
  const Keyframe* stood = stand_keyframe();
  Observations points = now;
  for (Observation& point : points) {
    const Observation* before = find_point(stood->points, point.track_id);
    point.uv = before != nullptr ? before->uv : point.uv;
  }
  stand_ = {frame.number, std::move(points), stand_.keyframe};
}

/// The tracks that began while the camera stood are in no other keyframe. One that stands again at
/// the same place has its keyframe there anew: a window of one place would know no depth.
void WindowEstimator::keep_stand() {
  Observations points = std::exchange(stand_.points, {});
  const int newest = window_.keyframes.back().frame;
  if (stand_.frame <= newest) {
    return;
  }
  Keyframe keyframe{stand_.frame, trajectory_[slot(stand_.frame)], std::move(points)};
  if (std::exchange(stand_.keyframe, stand_.frame) == newest) {
    leave(window_.keyframes.size() - 1, keyframe);
  }
  append(std::move(keyframe));
  history_.add_keyframe(stand_.frame);
}

/// Tracks that are where the stand's keyframe has them.
int WindowEstimator::num_standing(const Frame& frame, const Observations& now) const {
  const Keyframe* stood = stand_keyframe();
  if (!stood_ || is_initializing_ || stood == nullptr ||
      frame.time_s - times_s_[slot(stood->frame)] > kHidden_s) {
    return 0;
  }
  return static_cast<int>(std::ranges::count_if(now, [&](const Observation& point) {
    const Observation* before = find_point(stood->points, point.track_id);
    return before != nullptr && (point.uv - before->uv).norm() < min_flow_px();
  }));
}

/// Null: the frame is not to be measured against one.
const Keyframe* WindowEstimator::standing_keyframe(const Frame& frame,
                                                   const Observations& now) const {
  const Keyframe* stood = stand_keyframe();
  const bool is_one = stood != nullptr && frame.time_s - times_s_[slot(stood->frame)] < kHidden_s &&
                      find_seen_landmarks(window_, now).size() >= kMinLandmarks &&
                      common_points(stood->points, now).cur_uv.size() >= kMinTracks;
  return is_one ? stood : nullptr;
}

/// Nullopt: the reference is no stand, or nothing tells how long the way is.
std::optional<double> WindowEstimator::length_since_stand(const Observations& now,
                                                          const Rigid3& cur_from_stand) const {
  const View& stand = initializer_.reference();
  return stand.frame != stand_.frame
             ? std::nullopt
             : most_likely(measure_lengths(find_seen_landmarks(window_, now),
                                           stand.world_from_camera.inverse(), cur_from_stand,
                                           camera()));
}

}  // namespace stemvo
