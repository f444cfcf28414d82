// SPDX-License-Identifier: MIT
#pragma once

namespace stemvo {

/// Which two-view model a motion came from.
enum class TwoViewModel { kNone, kHomography, kEssential };

}  // namespace stemvo
