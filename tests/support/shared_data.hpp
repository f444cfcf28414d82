// SPDX-License-Identifier: MIT
#pragma once

#include "support/test.hpp"

namespace stemvo::testing {

/// $STEMVO_SHARED_DATA, empty where it is not set.
inline std::filesystem::path shared_data() {
  const char* folder = std::getenv("STEMVO_SHARED_DATA");
  return folder == nullptr ? "" : folder;
}

}  // namespace stemvo::testing

/// First line of a test that needs real data.
#define STEMVO_NEEDS_SHARED_DATA()                   \
  if (shared_data().empty()) {                       \
    GTEST_SKIP() << "STEMVO_SHARED_DATA is not set"; \
  }                                                  \
  static_assert(true, "")
