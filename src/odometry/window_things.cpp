// SPDX-License-Identifier: MIT
#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

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

}  // namespace

double WindowEstimator::share_that_fits(const Rigid3& cur_from_last,
                                        const Matches& matches,
                                        const std::vector<char>& mask) const {
  const auto cur = select<Eigen::Vector2d>(matches.cur_uv, mask);
  const std::vector<char> fits = epipolar_inliers(
      cur_from_last, {select<Eigen::Vector2d>(matches.prev_uv, mask), cur}, camera(), kFits_px);
  return cell_votes(cur, fits) / cell_votes(cur, std::vector<char>(fits.size(), 1));
}

std::optional<Localization> WindowEstimator::localize_without_thing(const Frame& frame,
                                                                    const Rigid3& found,
                                                                    std::vector<char>& mask) {
  const Matches& matches = frame.matches;
  const Rigid3 cur_from_last = found.inverse() * last_.world_from_camera;
  if (!is_last_localized_ || matches.prev_frame != last_.frame) {
    return std::nullopt;
  }
  const double fitting = share_that_fits(cur_from_last, matches, mask);
  if (fitting > kMinFitting) {
    return std::nullopt;
  }
  const MeasuredMotion motion =
      initializer_.measure_world({select<Eigen::Vector2d>(matches.prev_uv, mask),
                                  select<Eigen::Vector2d>(matches.cur_uv, mask)},
                                 camera());
  const std::vector<char> thing = scatter(motion.moving_mask, mask);
  std::vector<char> rest(mask.size());
  std::ranges::transform(mask, thing, rest.begin(),
                         [](char is_kept, char moves) { return is_kept != 0 && moves == 0; });
  const auto fits = [&](const std::vector<char>& party) {
    return share_that_fits(motion.cur_from_prev, matches, party);
  };
  const double turn_px = camera().mean_focal_px() * motion.cur_from_prev.angle_rad();
  const double size = cell_votes(matches.cur_uv, thing) / cell_votes(matches.cur_uv, mask);
  if (turn_px < kMinTurn_px || size < kMinThing || fits(thing) > kMaxOfThing ||
      fits(rest) < kMinOfRest || fits(mask) < kMinGain * fitting) {
    return std::nullopt;
  }
  const auto world =
      stemvo::localize(find_seen_landmarks(window_, current_points(matches, rest)),
                       predict(motion.cur_from_prev.rotation.conjugate()), camera(), localization_);
  if (world.has_value()) {
    moving_.add(matches, thing);
    mask = std::move(rest);
  }
  return world;
}

}  // namespace stemvo
