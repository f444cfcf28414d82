// SPDX-License-Identifier: MIT
#pragma once

#include <sstream>
#include <stdexcept>

namespace stemvo::internal {

[[noreturn]] inline void check_failed(const char* condition,
                                      const char* file,
                                      int line,
                                      const char* message) {
  std::ostringstream text;
  text << file << ":" << line << ": internal check failed: " << condition << " (" << message << ")";
  throw std::logic_error(text.str());
}

}  // namespace stemvo::internal

/// A promise of our own code. On in every build; throws std::logic_error, caught once in main().
/// Never use it for input from outside: that is an Error (error.hpp).
#define STEMVO_CHECK(condition, message)                                         \
  do {                                                                           \
    if (!(condition)) {                                                          \
      ::stemvo::internal::check_failed(#condition, __FILE__, __LINE__, message); \
    }                                                                            \
  } while (false)
