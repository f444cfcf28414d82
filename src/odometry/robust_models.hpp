// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include <Eigen/Core>

#include "stemvo/config.hpp"
#include "stemvo/geometry/camera.hpp"

namespace stemvo {

/// Hypotheses from OpenCV's robust estimators, all cur_from_prev, from matches in pixels. Single
/// threaded, from a fixed seed; nullopt when the input is degenerate or no model was found.
[[nodiscard]] std::optional<Eigen::Matrix3d> estimate_homography(
    std::span<const Eigen::Vector2d> prev_uv,
    std::span<const Eigen::Vector2d> cur_uv,
    const TwoViewOptions& options,
    std::uint64_t seed);

/// Pixels: x_cur^T F x_prev = 0.
[[nodiscard]] std::optional<Eigen::Matrix3d> estimate_fundamental(
    std::span<const Eigen::Vector2d> prev_uv,
    std::span<const Eigen::Vector2d> cur_uv,
    const TwoViewOptions& options,
    std::uint64_t seed);

/// Normalised coordinates: x_cur^T E x_prev = 0.
[[nodiscard]] std::optional<Eigen::Matrix3d> estimate_essential(
    std::span<const Eigen::Vector2d> prev_uv,
    std::span<const Eigen::Vector2d> cur_uv,
    const Camera& camera,
    const TwoViewOptions& options,
    std::uint64_t seed);

}  // namespace stemvo
