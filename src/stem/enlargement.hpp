// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <string_view>

namespace stemvo {

/// How many times larger than its channel a picture is, for a stem.upsample that is not auto;
/// `sampling`: input pixels per pixel of the channel.
[[nodiscard]] inline int enlargement(std::string_view upsample, int sampling) {
  if (upsample == "native") {
    return 1;
  }
  return upsample == "half" ? std::max(1, sampling / 2) : sampling;
}

}  // namespace stemvo
