// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include "internal_check.hpp"

namespace stemvo {

/// A duration in whole microseconds. Seconds since 1970 leave a double 0.2 us: a recording whose
/// times count from there lasts as long as one whose times begin at 0, but for that.
[[nodiscard]] inline double whole_us(double duration_s) {
  return std::round(1e6 * duration_s) / 1e6;
}

/// Time since the first frame, in whole microseconds.
class FrameClock {
 public:
  /// The next frame was taken then: after the one before (checked); here at least 1 us after it.
  [[nodiscard]] double advance(double given_s) {
    STEMVO_CHECK(given_s > last_given_s_, "times rise");
    first_given_s_ = std::isfinite(last_given_s_) ? first_given_s_ : given_s;
    last_given_s_ = given_s;
    const double least_s = std::max(now_s_ + 1e-6, std::nextafter(now_s_, -kNever_s));
    return now_s_ = std::max(since_first(given_s), least_s);
  }
  /// Times of what was measured beside the frames.
  [[nodiscard]] double since_first(double given_s) const {
    return whole_us(given_s - first_given_s_);
  }

 private:
  static constexpr double kNever_s = -std::numeric_limits<double>::infinity();
  double first_given_s_ = 0.0;
  double last_given_s_ = kNever_s;
  double now_s_ = kNever_s;
};

/// Milliseconds since construction or the last call.
class Stopwatch {
 public:
  double lap_ms() {
    const auto now = std::chrono::steady_clock::now();
    const double elapsed = std::chrono::duration<double, std::milli>(now - last_).count();
    last_ = now;
    return elapsed;
  }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

}  // namespace stemvo
