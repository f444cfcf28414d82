// SPDX-License-Identifier: MIT
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

namespace stemvo {

/// How much of an image agrees: each square cell that shows points, a twelfth of the width that all
/// of them span, has one vote, shared by its points. So a textured thing has no more votes than its
/// size gives it. `agrees`: one flag per point.
[[nodiscard]] double cell_votes(std::span<const Eigen::Vector2d> uv,
                                const std::vector<char>& agrees);

/// For each point the share of its cell's points that agree.
[[nodiscard]] std::vector<double> cell_shares(std::span<const Eigen::Vector2d> uv,
                                              const std::vector<char>& agrees);

}  // namespace stemvo
