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
// its points are landmarks at infinity, and those hold the camera's rotation when it turns.

namespace {

/// A pose of the world fits most of the image's cells so well; that of a thing, which the rest
/// only nearly fits, does not.
constexpr double kFits_px = 0.7;
constexpr double kMinFitting = 0.7;
/// A thing of so much of the image moves on its own: the other motion fits it hardly, the rest of
/// the image well, and more of all than the pose does. Smaller ones are outvoted; and what bends
/// with a rolling shutter is no thing.
constexpr double kMinThing = 0.3;
constexpr double kMaxOfThing = 0.2;
constexpr double kMinOfRest = 0.6;
constexpr double kMinGain = 1.05;
/// Where the camera hardly turns, a thing that keeps its distance does no harm, and who brakes
/// before crossing cars is not made to move with them.
constexpr double kMinTurn_px = 2.0;

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

std::optional<Localization> WindowEstimator::localize_by_rest(const Rigid3& found,
                                                              const Matches& matches,
                                                              const std::vector<char>& mask,
                                                              std::vector<char>& thing) const {
  const double fitting = share_that_fits(found.inverse() * last_.world_from_camera, matches, mask);
  if (fitting > kMinFitting) {
    return std::nullopt;
  }
  const MeasuredMotion motion = initializer_.measure_world(
      {select(matches.prev_uv, mask), select(matches.cur_uv, mask)}, camera());
  thing = scatter(motion.moving_mask, mask);
  const std::vector<char> rest = without(thing, mask);
  const auto fits = [&](const std::vector<char>& party) {
    return share_that_fits(motion.cur_from_prev, matches, party);
  };
  const double turn_px = camera().mean_focal_px() * motion.cur_from_prev.angle_rad();
  const double size = cell_votes(matches.cur_uv, thing) / cell_votes(matches.cur_uv, mask);
  if (turn_px < kMinTurn_px || size < kMinThing || fits(thing) > kMaxOfThing ||
      fits(rest) < kMinOfRest || fits(mask) < kMinGain * fitting) {
    return std::nullopt;
  }
  return stemvo::localize(find_seen_landmarks(window_, current_points(matches, rest)),
                          predict(motion.cur_from_prev.rotation.conjugate()), camera(),
                          localization_);
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
  std::optional<Localization> world = localize_by_near(seen, found, matches, thing);
  if (!world.has_value() && is_last_localized_ && matches.prev_frame == last_.frame) {
    world = localize_by_rest(found, matches, mask, thing);
  }
  if (!world.has_value()) {
    return found;
  }
  moving_.add(matches, thing);
  mask = without(thing, mask);
  return world->world_from_camera;
}

}  // namespace stemvo
