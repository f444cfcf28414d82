// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace stemvo {

/// Lengths of errors with equal sigmas in u and v have Rayleigh's distribution: its median is so
/// many sigmas.
inline constexpr double kMedianOfRayleigh = 1.1774;

/// The middle value, of an even number the upper one of the two; 0 of none.
inline double median(std::vector<double> values) {
  if (values.empty()) {
    return 0.0;
  }
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace stemvo
