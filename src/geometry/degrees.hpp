// SPDX-License-Identifier: MIT
#pragma once

#include <numbers>

namespace stemvo {

inline constexpr double kDegPerRad = 180.0 / std::numbers::pi;

}  // namespace stemvo
