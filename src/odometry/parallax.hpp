// SPDX-License-Identifier: MIT
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "stemvo/geometry/camera.hpp"
#include "stemvo/geometry/rigid3.hpp"

namespace stemvo {

// Of matches in input pixels. Medians: up to half of the matches may be wrong.

/// Median length of noise in two images over its median distance from epipolar lines: 2.5 where it
/// is equal in all directions (1.177 sqrt(2) / 0.6745), 3-4.5 on rendered turns of 18 px a frame.
/// The slowest steps that can be seen have 10 and more.
inline constexpr double kNoiseParallax = 5.0;

/// Length of the flow.
[[nodiscard]] double median_flow_px(std::span<const Eigen::Vector2d> prev_uv,
                                    std::span<const Eigen::Vector2d> cur_uv);

/// What is left of the flow once the rotation, cur_from_prev, is taken out.
[[nodiscard]] double median_parallax_px(const Eigen::Quaterniond& rotation,
                                        std::span<const Eigen::Vector2d> prev_uv,
                                        std::span<const Eigen::Vector2d> cur_uv,
                                        const Camera& camera);

/// The same, root mean square: every match counts, so wrong ones must be out.
[[nodiscard]] double rms_parallax_px(const Eigen::Quaterniond& rotation,
                                     std::span<const Eigen::Vector2d> prev_uv,
                                     std::span<const Eigen::Vector2d> cur_uv,
                                     const Camera& camera);

/// Distance to the epipolar lines in both images (Sampson).
[[nodiscard]] double median_epipolar_px(const Rigid3& cur_from_prev,
                                        std::span<const Eigen::Vector2d> prev_uv,
                                        std::span<const Eigen::Vector2d> cur_uv,
                                        const Camera& camera);

/// Matches within `bound_px` of their epipolar lines; one flag per match.
[[nodiscard]] std::vector<char> epipolar_inliers(const Rigid3& cur_from_prev,
                                                 std::span<const Eigen::Vector2d> prev_uv,
                                                 std::span<const Eigen::Vector2d> cur_uv,
                                                 const Camera& camera,
                                                 double bound_px);

}  // namespace stemvo
