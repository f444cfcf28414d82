// SPDX-License-Identifier: MIT
#pragma once

// Code that is compiled once for every processor and once for those with AVX2 and FMA: the body is
// STEMVO_INLINE, and called from a plain function and from one that is STEMVO_AVX2.

#define STEMVO_INLINE inline __attribute__((always_inline))

#if defined(__x86_64__)
#define STEMVO_AVX2 __attribute__((target("avx2,fma")))
#endif

namespace stemvo {

/// Whether this processor has what STEMVO_AVX2 is compiled for.
[[nodiscard]] inline bool has_avx2() {
#if defined(__x86_64__)
  static const bool has = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  return has;
#else
  return false;
#endif
}

}  // namespace stemvo
