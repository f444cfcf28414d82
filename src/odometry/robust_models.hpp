// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include <Eigen/Core>

#include "geometry/pixel_pairs.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/options.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// Hypotheses from OpenCV's robust estimators, all cur_from_prev, from matches in pixels. Single
/// threaded, from a fixed seed; nullopt when the input is degenerate or no model was found.
[[nodiscard]] std::optional<Eigen::Matrix3d> estimate_homography(const PixelPairs& pairs,
                                                                 const TwoViewOptions& options,
                                                                 std::uint64_t seed);

/// Pixels: x_cur^T F x_prev = 0.
[[nodiscard]] std::optional<Eigen::Matrix3d> estimate_fundamental(const PixelPairs& pairs,
                                                                  const TwoViewOptions& options,
                                                                  std::uint64_t seed);

/// Normalised coordinates: x_cur^T E x_prev = 0.
[[nodiscard]] std::optional<Eigen::Matrix3d> estimate_essential(const PixelPairs& pairs,
                                                                const Camera& camera,
                                                                const TwoViewOptions& options,
                                                                std::uint64_t seed);

/// camera_from_world from 2D-3D matches of which many may be wrong: samples of three points (P3P),
/// consensus within `bound_px` of reprojection. A start for refine_absolute_pose. nullopt for fewer
/// than 8 matches, and where no pose was found.
[[nodiscard]] std::optional<Rigid3> estimate_absolute_pose(
    std::span<const Eigen::Vector3d> points_in_world,
    std::span<const Eigen::Vector2d> uv,
    const Camera& camera,
    double bound_px,
    std::uint64_t seed);

}  // namespace stemvo
