// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "features/front_end.hpp"
#include "geometry/pixel_pairs.hpp"
#include "odometry/two_view_estimator.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/options.hpp"

namespace stemvo {

/// How much of an image agrees: each square cell that shows points, a twelfth of the width that all
/// of them span, has one vote, shared by its points. So a textured thing has no more votes than its
/// size gives it. `agrees`: one flag per point.
[[nodiscard]] double cell_votes(std::span<const Eigen::Vector2d> uv,
                                const std::vector<char>& agrees);

/// The flags of a mask but for some.
[[nodiscard]] std::vector<char> without(const std::vector<char>& some,
                                        const std::vector<char>& mask);

/// Two motions that exclude each other, each with matches of its own: the camera's through the
/// world, and a thing's that moves by itself.
struct MotionRivals {
  MeasuredMotion world;           ///< its inlier_mask is one per match of `world_party`
  std::vector<char> world_party;  ///< one per match: the world's motion was measured on it
  bool is_contested = false;      ///< later frames may tell that the thing is the world
};

/// One flag per member of a party as one per match of all; others have 0.
[[nodiscard]] std::vector<char> scatter(const std::vector<char>& flags,
                                        const std::vector<char>& party);

/// Tells the world's motion from that of a thing before the camera by one pair of frames, nothing
/// else being known. `all`, measured on all matches, names the dominant homography: what it
/// explains is one party, a motion of the other matches the second one. They are rivals where the
/// second does not explain the first party, and `all` explains clearly less than both. The world is
/// the one that more of the image's cells agree with; a thing is nearly a plane, so one that only
/// depth explains needs half as many. nullopt: no rivals, `all` is the motion.
[[nodiscard]] std::optional<MotionRivals> find_rivals(const MeasuredMotion& all,
                                                      const PixelPairs& pairs,
                                                      const Camera& camera,
                                                      const TwoViewOptions& options,
                                                      const TwoViewEstimator& estimator);

/// Tracks of things that move on their own: neither landmarks nor voters. They are followed, so
/// that no new corner of the same thing takes their place each frame.
class MovingTracks {
 public:
  explicit MovingTracks(const Options& config)
      : options_(config.two_view),
        seed_(config.seed),
        border_px_(2.0 * config.features.min_distance_px) {}

  void clear() {
    evidence_.clear();
    num_apart_ = 0;
  }
  /// `moving_mask`, one per match: these move as a thing does.
  void add(const Matches& matches, const std::vector<char>& moving_mask);
  /// A localized frame. What does not fit its pose is a thing where it is so much of the image that
  /// it may mislead, and moves as one, in two frames one after the other. `fits_pose`: one per
  /// match.
  void find(const Matches& matches, const std::vector<char>& fits_pose);
  /// A localized frame: tracks join that move as the things do, those leave that move as the world
  /// does; where both move alike, none does. `fits_world`: one per match.
  void observe(const Matches& matches, const std::vector<char>& fits_world);

  [[nodiscard]] bool empty() const { return evidence_.empty(); }
  /// One per match: tracks of things.
  [[nodiscard]] std::vector<char> members(const Matches& matches) const;
  /// One per match: these, and those beside one that are no landmarks. The patch of a
  /// corner at a thing's edge moves with both, and would be a landmark at a depth where nothing is.
  [[nodiscard]] std::vector<char> flags(const Matches& matches,
                                        const std::map<int, Eigen::Vector3d>& landmarks) const;

 private:
  /// Those of some matches that move as a plane does, one per match of all.
  [[nodiscard]] std::optional<std::vector<char>> move_as_one(const Matches& matches,
                                                             const std::vector<char>& some) const;

  TwoViewOptions options_;
  std::uint64_t seed_;
  double border_px_;
  int num_apart_ = 0;            ///< frames, the last ones, in which a new thing moved
  std::map<int, int> evidence_;  ///< by track id: frames for a thing less those for the world
};

}  // namespace stemvo
