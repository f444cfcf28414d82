// SPDX-License-Identifier: MIT
#pragma once

#include <optional>
#include <vector>

#include "geometry/pixel_pairs.hpp"
#include "odometry/two_view_estimator.hpp"
#include "stemvo/camera.hpp"

namespace stemvo {

/// Two motions that exclude each other, each with matches of its own: the camera's through the
/// world, and a thing's that moves by itself.
struct MotionRivals {
  MeasuredMotion world;           ///< its mask is one per match of `world_party`
  std::vector<char> world_party;  ///< one per match: the world's motion was measured on it
  std::vector<char> moving_mask;  ///< one per match: it moves as the thing does
  bool is_contested = false;      ///< later frames may tell that the thing is the world
};

/// One flag per member of a party as one per match of all; others have 0.
[[nodiscard]] std::vector<char> scatter(const std::vector<char>& flags,
                                        const std::vector<char>& party);

/// Tells the world's motion from that of a thing before the camera by one pair of frames, nothing
/// else being known. `all`, measured on all matches, names the dominant homography: what it
/// explains is one party, a motion of the other matches the second one. They are rivals where the
/// second does not explain the first party. The world is the one that more of the image's cells
/// agree with; a thing is nearly a plane, so one that only depth explains needs half as many.
/// nullopt: no rivals, `all` is the motion.
[[nodiscard]] std::optional<MotionRivals> find_rivals(const MeasuredMotion& all,
                                                      const PixelPairs& pairs,
                                                      const Camera& camera,
                                                      const TwoViewOptions& options,
                                                      const TwoViewEstimator& estimator);

}  // namespace stemvo
