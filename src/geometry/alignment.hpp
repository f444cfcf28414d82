// SPDX-License-Identifier: MIT
#pragma once

#include <span>

#include <Eigen/Core>

#include "stemvo/rigid3.hpp"

namespace stemvo {

/// How an estimate is fitted to the ground truth before its error is taken.
enum class Alignment { kNone, kScale, kSe3, kSim3 };

/// target_from_source: least-squares fit of positions (Umeyama 1991; kScale: s = sum(x.y)/sum(x.x)
/// about the origin, as kitti-odom-eval does). Same length, any number of points. The undefined
/// part stays as it is: no rotation and scale 1 where all points coincide, the smallest rotation
/// where all lie on a line, the identity for no points or points that are not numbers.
[[nodiscard]] Similarity3 align_positions(std::span<const Eigen::Vector3d> source,
                                          std::span<const Eigen::Vector3d> target,
                                          Alignment alignment);

}  // namespace stemvo
