// SPDX-License-Identifier: MIT
#pragma once

#include "io/png.hpp"

namespace stemvo::fuzz {

/// More pixels than a fuzzer has time for.
[[nodiscard]] bool is_large_png(io::Bytes bytes);

}  // namespace stemvo::fuzz
