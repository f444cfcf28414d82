// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstdint>

namespace stemvo::synth {

/// splitmix64's finaliser (Steele, Lea, Flood 2014): every bit of the result depends on every bit
/// of the input. All randomness of a drive comes from it, by what is drawn and never by when, so
/// that neither the order of the work nor the number of threads matters.
[[nodiscard]] constexpr std::uint64_t mix(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}

template <typename... Keys>
[[nodiscard]] constexpr std::uint64_t hash_of(std::uint64_t seed, Keys... keys) {
  std::uint64_t h = mix(seed);
  ((h = mix(h ^ static_cast<std::uint64_t>(keys))), ...);
  return h;
}

/// [0, 1).
[[nodiscard]] constexpr double unit(std::uint64_t hash) {
  return static_cast<double>(hash >> 11) * 0x1.0p-53;
}

/// A row of draws for one object, named by its keys.
class Draw {
 public:
  template <typename... Keys>
  explicit Draw(std::uint64_t seed, Keys... keys) : state_(hash_of(seed, keys...)) {}

  [[nodiscard]] double next() { return unit(state_ = mix(state_)); }
  [[nodiscard]] double in(double low, double high) { return low + (high - low) * next(); }
  [[nodiscard]] bool chance(double probability) { return next() < probability; }
  [[nodiscard]] std::uint32_t bits() {
    return static_cast<std::uint32_t>((state_ = mix(state_)) >> 32);
  }

 private:
  std::uint64_t state_;
};

}  // namespace stemvo::synth
