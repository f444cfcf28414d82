// SPDX-License-Identifier: MIT
#pragma once

#include <string_view>

#define STEMVO_VERSION_MAJOR 0
#define STEMVO_VERSION_MINOR 1
#define STEMVO_VERSION_PATCH 0
#define STEMVO_VERSION "0.1.0"

namespace stemvo {

/// Version of the library, with the git commit it was built from where there was one (marked where
/// the tree had changes): "0.1.0", "0.1.0+1a2b3c4d5e6f" or "0.1.0+1a2b3c4d5e6f.dirty".
[[nodiscard]] std::string_view version();

}  // namespace stemvo
