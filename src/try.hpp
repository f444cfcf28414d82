// SPDX-License-Identifier: MIT
#pragma once

#include <utility>

// Both pass an Error on: they return it from the function they stand in.

/// Does what returns a Status.
#define STEMVO_TRY(...)                             \
  do {                                              \
    if (const auto tried_ = __VA_ARGS__; !tried_) { \
      return tried_.error();                        \
    }                                               \
  } while (false)

/// Declares a variable that takes the value of an Expected:
/// `STEMVO_TRY_GET(const auto lines, read_lines(file));`
#define STEMVO_TRY_GET(declaration, ...) \
  STEMVO_TRY_GET_BY(STEMVO_TRY_JOIN(tried_, __LINE__), declaration, __VA_ARGS__)
#define STEMVO_TRY_GET_BY(tried, declaration, ...) \
  auto&& tried = __VA_ARGS__;                      \
  if (!tried) {                                    \
    return tried.error();                          \
  }                                                \
  declaration = *std::move(tried)
#define STEMVO_TRY_JOIN(a, b) STEMVO_TRY_JOIN_(a, b)
#define STEMVO_TRY_JOIN_(a, b) a##b
