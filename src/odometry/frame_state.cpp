// SPDX-License-Identifier: MIT
#include <array>
#include <cstddef>

#include "stemvo/frame_result.hpp"

namespace stemvo {

std::string_view to_string(FrameState state) {
  constexpr std::array<std::string_view, 9> kNames{"first",      "initializing", "tracking",
                                                   "stationary", "low_parallax", "rotating",
                                                   "gated",      "lost",         "no_image"};
  static_assert(kNames.size() == static_cast<std::size_t>(FrameState::kNoImage) + 1);
  return kNames.at(static_cast<std::size_t>(state));
}

bool is_measured(FrameState state) {
  return state != FrameState::kGated && state != FrameState::kLost && state != FrameState::kNoImage;
}

std::string_view to_string(ScaleState state) {
  constexpr std::array<std::string_view, 4> kNames{"disabled", "none", "held", "measured"};
  static_assert(kNames.size() == static_cast<std::size_t>(ScaleState::kMeasured) + 1);
  return kNames.at(static_cast<std::size_t>(state));
}

}  // namespace stemvo
