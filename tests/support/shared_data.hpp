// SPDX-License-Identifier: MIT
#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>

#include <gtest/gtest.h>

namespace stemvo::testing {

/// $STEMVO_SHARED_DATA, empty where it is not set.
inline std::filesystem::path shared_data() {
  const char* folder = std::getenv("STEMVO_SHARED_DATA");
  return folder == nullptr ? "" : folder;
}

}  // namespace stemvo::testing

/// First line of a test that needs real data.
#define STEMVO_NEEDS_SHARED_DATA()                   \
  if (::stemvo::testing::shared_data().empty()) {    \
    GTEST_SKIP() << "STEMVO_SHARED_DATA is not set"; \
  }                                                  \
  static_assert(true, "")
