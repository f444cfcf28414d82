// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

#include "stemvo/geometry/camera.hpp"
#include "stemvo/geometry/rigid3.hpp"

namespace stemvo {

/// One hypothesis of Faugeras & Lustman: |translation| == 1, plane normal in the previous camera
/// with n_z >= 0.
struct PlanarMotion {
  Rigid3 cur_from_prev;
  Eigen::Vector3d normal_in_prev = Eigen::Vector3d::UnitZ();
};

/// The 8 hypotheses of H (pixels, cur_from_prev): lambda K^-1 H K = R + T n^T / d, where the
/// distance d of the plane may be negative, since n_z >= 0 fixes the sign of n. Empty when two
/// singular values of K^-1 H K coincide (ratio < 1.00001: pure rotation or degenerate), or H is not
/// finite or has rank 1.
[[nodiscard]] std::vector<PlanarMotion> decompose_homography(const Eigen::Matrix3d& homography,
                                                             const Camera& camera);

/// The 4 hypotheses {U W V^T, U W^T V^T} x {+u3, -u3}; |translation| == 1.
/// E may have any scale; one that is not finite gives four identities without translation.
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
