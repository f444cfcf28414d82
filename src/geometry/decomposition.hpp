// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

#include "stemvo/camera.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// The 8 hypotheses of H (pixels, cur_from_prev) by Faugeras & Lustman, lambda K^-1 H K = R + T
/// n^T; |translation| == 1. Empty when two singular values of K^-1 H K coincide (ratio < 1.00001:
/// pure rotation or degenerate), or H has rank 1.
[[nodiscard]] std::vector<Rigid3> decompose_homography(const Eigen::Matrix3d& homography,
                                                       const Camera& camera);

/// The 4 hypotheses {U W V^T, U W^T V^T} x {+u3, -u3}; |translation| == 1.
/// E may have any scale.
[[nodiscard]] std::array<Rigid3, 4> decompose_essential(const Eigen::Matrix3d& essential);

/// E = K^T F K.
[[nodiscard]] Eigen::Matrix3d essential_from_fundamental(const Eigen::Matrix3d& fundamental,
                                                         const Camera& camera);
/// F = K^-T E K^-1.
[[nodiscard]] Eigen::Matrix3d fundamental_from_essential(const Eigen::Matrix3d& essential,
                                                         const Camera& camera);
/// E = [t]x R.
[[nodiscard]] Eigen::Matrix3d essential_from_motion(const Rigid3& cur_from_prev);

}  // namespace stemvo
