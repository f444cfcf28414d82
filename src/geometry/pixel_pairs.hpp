// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <span>

#include <Eigen/Core>

#include "internal_check.hpp"

namespace stemvo {

/// A view of the matches between two images, input pixels: as many in one as in the other
/// (checked).
struct PixelPairs {
  using Points = std::span<const Eigen::Vector2d>;

  PixelPairs(Points prev, Points cur) : prev_uv(prev), cur_uv(cur) {
    STEMVO_CHECK(prev.size() == cur.size(), "matches come in pairs");
  }
  [[nodiscard]] std::size_t size() const { return prev_uv.size(); }

  Points prev_uv;
  Points cur_uv;
};

}  // namespace stemvo
