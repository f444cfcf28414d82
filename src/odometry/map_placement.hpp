// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "odometry/local_map.hpp"
#include "stemvo/features/front_end.hpp"
#include "stemvo/geometry/absolute_pose.hpp"
#include "stemvo/geometry/camera.hpp"
#include "stemvo/geometry/rigid3.hpp"

namespace stemvo {

/// The landmarks among a frame's matches, and where the frame sees them.
struct SeenLandmarks {
  std::vector<Eigen::Vector3d> points;  ///< in the world
  std::vector<Eigen::Vector2d> uv;
  std::vector<char> is_inlier;  ///< of the two-frame motion

  [[nodiscard]] int size() const { return static_cast<int>(points.size()); }
};

[[nodiscard]] SeenLandmarks find_seen_landmarks(const LocalMap& map,
                                                const Matches& matches,
                                                const std::vector<char>& is_inlier);

struct PlacementOptions {
  AbsolutePoseOptions pose;
  int min_landmarks = 30;      ///< that agree with a pose; fewer: there is none
  double min_agreement = 0.5;  ///< share of the landmarks seen; less: the guess was wrong
  std::uint64_t seed = 1;      ///< of the search without a guess
};

/// Where a frame is by the landmarks it sees.
struct Placement {
  Rigid3 world_from_camera;
  int num_agreeing = 0;  ///< of all landmarks seen, within the bound
};

/// From a guess, by the inliers of the two-frame motion alone. nullopt: too few.
[[nodiscard]] std::optional<Placement> place_from_guess(const SeenLandmarks& seen,
                                                        const Rigid3& world_from_camera,
                                                        const Camera& camera,
                                                        const PlacementOptions& options);
/// Without a guess, among all landmarks seen. nullopt: too few agree with any pose.
[[nodiscard]] std::optional<Placement> place_by_search(const SeenLandmarks& seen,
                                                       const Camera& camera,
                                                       const PlacementOptions& options);

}  // namespace stemvo
