// SPDX-License-Identifier: MIT
#pragma once

#include <chrono>
#include <cstddef>
#include <string>

namespace stemvo::apps {

/// From here on the first SIGINT or SIGTERM asks the program to stop and write what it has; the
/// second ends it at once.
void catch_interrupts();

/// True once an interrupt came.
[[nodiscard]] bool is_interrupted();

/// Progress on standard error: one line that changes on a terminal, a plain line every few seconds
/// otherwise, nothing when quiet.
class Progress {
 public:
  /// `unit`: what is counted, e.g. "frames".
  Progress(std::string unit, bool is_quiet);

  /// After each unit of work; `total` 0: not known. False once the user interrupted, so that it
  /// fits as a callback.
  bool operator()(std::size_t done, std::size_t total);

 private:
  using Clock = std::chrono::steady_clock;
  [[nodiscard]] std::string line(std::size_t done,
                                 std::size_t total,
                                 double elapsed_s,
                                 bool is_last) const;

  std::string unit_;
  bool is_quiet_;
  bool is_terminal_;
  Clock::time_point start_;
  Clock::time_point last_;
};

}  // namespace stemvo::apps
