// SPDX-License-Identifier: MIT
#pragma once

#include <optional>
#include <string>

#include "stem/stem.hpp"

namespace stemvo {

/// Whether it names channels without a network, to compare a learned one with.
[[nodiscard]] bool is_hand_made(const std::string& model);

namespace internal {

struct HandMadeBank {
  int num_filters = 1;
  FilterBank bank;
};
/// nullopt: not a name of one.
[[nodiscard]] std::optional<HandMadeBank> hand_made_bank(const std::string& model);

}  // namespace internal
}  // namespace stemvo
