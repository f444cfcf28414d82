// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cstddef>
#include <numbers>
#include <optional>
#include <span>
#include <vector>

#include "geometry/median.hpp"
#include "odometry/tracks.hpp"
#include "odometry/window_estimator.hpp"

namespace stemvo {

// A thing that came before the camera after the map was opened. As long as it keeps its distance
// its points are landmarks at infinity, and those hold the camera's rotation when it turns; where
// they have taken the map along, it ends.

namespace {

/// A motion between two images fits the cells whose matches are so near their epipolar lines.
constexpr double kFits_px = 0.7;
/// A map is a thing's where its pose fits no more than this share of the image ..
constexpr double kMinFitting = 0.7;
/// .. over this much of the thing, and of the rest under half of what another motion fits, which
/// fits over so much of it and under half of the thing; and that in so many frames.
constexpr double kMinOfThing = 0.9;
constexpr double kMinOfRest = 0.6;
constexpr double kHalf = 0.5;
constexpr int kTaken = 3;

/// A landmark is near that the window sees under more than this.
constexpr double kNear_rad = 1.5 * std::numbers::pi / 180.0;
constexpr std::ptrdiff_t kMinNear = 20;
/// Far landmarks are a thing's where they are so much of the image, and most of them are so far
/// from where the near ones' pose has them, and so many times as far as those.
constexpr double kMinFar = 0.2;
constexpr double kOff_px = 1.0;
constexpr double kOffTimes = 3.0;
/// It holds the rotation alone: the near ones place the camera where all do (share of the step); or
/// with it they fit so many times worse. Elsewhere they are too few, or a shutter that rolls bends
/// the image.
constexpr double kMaxShift = 0.03;
constexpr double kWorse = 2.5;

/// One flag per landmark: its parallax since the first keyframe that sees it.
std::vector<char> are_near(const Window& window, const SeenLandmarks& seen, const Rigid3& pose) {
  std::vector<char> flags(seen.points.size());
  ObservationWalk walk(window);
  for (std::size_t i = 0; i < flags.size(); ++i) {
    const std::span<const KeyframeObservation> views = walk.seek(seen.track_ids[i]);
    flags[i] = static_cast<char>(
        !views.empty() &&
        parallax_rad(seen.points[i], window.keyframes[views.front().keyframe].world_from_camera,
                     pose) > kNear_rad);
  }
  return flags;
}

}  // namespace

double WindowEstimator::share_that_fits(const Rigid3& cur_from_last,
                                        const Matches& matches,
                                        const std::vector<char>& mask) const {
  const auto cur = select(matches.cur_uv, mask);
  const std::vector<char> fits =
      epipolar_inliers(cur_from_last, {select(matches.prev_uv, mask), cur}, camera(), kFits_px);
  return cell_votes(cur, fits) / cell_votes(cur, std::vector<char>(fits.size(), 1));
}

bool WindowEstimator::is_map_of_thing(const Rigid3& found,
                                      const Matches& matches,
                                      const std::vector<char>& mask) {
  const Rigid3 cur_from_last = found.inverse() * last_.world_from_camera;
  if (!is_since_last(matches) || share_that_fits(cur_from_last, matches, mask) > kMinFitting) {
    num_taken_ = 0;
    return false;
  }
  const MeasuredMotion other = initializer_.measure_world(
      {select(matches.prev_uv, mask), select(matches.cur_uv, mask)}, camera());
  const std::vector<char> thing = scatter(other.moving_mask, mask);
  if (std::ranges::count(thing, char{1}) == 0) {  // two motions were not told apart
    return false;
  }
  const std::vector<char> rest = without(thing, mask);
  const double of_rest = share_that_fits(other.cur_from_prev, matches, rest);
  const bool is_taken = of_rest > kMinOfRest &&
                        share_that_fits(cur_from_last, matches, thing) > kMinOfThing &&
                        share_that_fits(cur_from_last, matches, rest) < kHalf * of_rest &&
                        share_that_fits(other.cur_from_prev, matches, thing) < kHalf;
  num_taken_ = is_taken ? num_taken_ + 1 : 0;
  return num_taken_ >= kTaken;
}

/// The map is of a thing: the world gets one of its own.
FrameState WindowEstimator::begin_anew(const Frame& frame, LocalizedFrame& localized) {
  close_window();
  motion_.restart();
  stood_ = false;
  reset_reference({last_.frame, last_.world_from_camera, {}, last_.time_s, last_.road});
  std::vector<char>& mask = localized.inlier_mask;
  mask.assign(mask.size(), 1);
  return measure_since_reference(frame, current_points(frame.matches, mask), localized);
}

std::optional<Localization> WindowEstimator::localize_by_near(const SeenLandmarks& seen,
                                                              const Rigid3& found,
                                                              const Matches& matches,
                                                              std::vector<char>& thing) const {
  const std::vector<char> is_near = are_near(window_, seen, found);
  const double all_votes = cell_votes(seen.uv, std::vector<char>(is_near.size(), 1));
  if (std::ranges::count(is_near, char{1}) < kMinNear ||
      all_votes - cell_votes(seen.uv, is_near) < kMinFar * all_votes) {
    return std::nullopt;
  }
  const auto world = stemvo::localize(select(seen, is_near), found, camera(), localization_);
  if (!world.has_value()) {
    return std::nullopt;
  }
  const auto way = [&](const Rigid3& from) {
    return (world->world_from_camera.translation - from.translation).norm();
  };
  const auto near_px = [&](const std::vector<double>& errors_px) {
    return median(select(errors_px, is_near));
  };
  const std::vector<double> errors_px =
      distances_px(seen, world->world_from_camera.inverse(), camera());
  if (way(found) > kMaxShift * way(last_.world_from_camera) &&
      near_px(distances_px(seen, found.inverse(), camera())) < kWorse * near_px(errors_px)) {
    return std::nullopt;
  }
  const std::vector<char> is_far = without(is_near, std::vector<char>(is_near.size(), 1));
  const double bound_px = std::max(kOff_px, kOffTimes * near_px(errors_px));
  std::vector<char> is_off(is_near.size());
  std::ranges::transform(errors_px, is_far, is_off.begin(), [&](double error_px, char far) {
    return static_cast<char>(far != 0 && error_px > bound_px);
  });
  if (median(select(errors_px, is_far)) < bound_px ||
      cell_votes(seen.uv, is_off) < kMinFar * all_votes) {
    return std::nullopt;
  }
  const std::vector<int> off = select(seen.track_ids, is_off);
  std::ranges::transform(matches.track_ids, thing.begin(), [&](int track_id) {
    return static_cast<char>(std::ranges::binary_search(off, track_id));
  });
  return world;
}

Rigid3 WindowEstimator::pose_without_thing(const Frame& frame,
                                           const SeenLandmarks& seen,
                                           const Rigid3& found,
                                           std::vector<char>& mask) {
  const Matches& matches = frame.matches;
  std::vector<char> thing(mask.size());
  const std::optional<Localization> world = localize_by_near(seen, found, matches, thing);
  if (!world.has_value()) {
    return found;
  }
  moving_.add(matches, thing);
  mask = without(thing, mask);
  return world->world_from_camera;
}

}  // namespace stemvo
