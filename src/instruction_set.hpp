// SPDX-License-Identifier: MIT
#pragma once

#include <cstdlib>
#include <string_view>

// Code that is compiled once for every processor and once for those with AVX2 and FMA: the body is
// STEMVO_INLINE, and called from portable_copy() and from avx2_copy().

#define STEMVO_INLINE inline __attribute__((always_inline))

#if defined(__x86_64__)
/// A processor that has both counts bits, too.
#define STEMVO_AVX2 __attribute__((target("avx2,fma,popcnt")))
#endif

namespace stemvo {

/// Whether the environment asks for the code that is compiled for every processor.
[[nodiscard]] inline bool is_portable_asked_for() {
  const char* value = std::getenv("STEMVO_PORTABLE");
  return value != nullptr && std::string_view(value) == "1";
}

/// Whether what is STEMVO_AVX2 runs: this processor has what it is compiled for, and the portable
/// code is not asked for. Decided once: a process keeps to one set.
[[nodiscard]] inline bool uses_avx2() {
#if defined(__x86_64__)
  static const bool uses =
      __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && !is_portable_asked_for();
  return uses;
#else
  return false;
#endif
}

/// A body as it is compiled for every processor.
template <auto kBody, typename... Arguments>
void portable_copy(Arguments... arguments) {
  kBody(arguments...);
}
#if defined(__x86_64__)
template <auto kBody, typename... Arguments>
STEMVO_AVX2 void avx2_copy(Arguments... arguments) {
  kBody(arguments...);
}
#endif

/// Calls a body as it is compiled for this process.
template <auto kBody, typename... Arguments>
void run_body(Arguments&... arguments) {
#if defined(__x86_64__)
  if (uses_avx2()) {
    return avx2_copy<kBody, Arguments&...>(arguments...);
  }
#endif
  portable_copy<kBody, Arguments&...>(arguments...);
}

}  // namespace stemvo
