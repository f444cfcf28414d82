// SPDX-License-Identifier: MIT
#pragma once

#include <chrono>
#include <cstddef>
#include <optional>
#include <string>
#include <utility>

namespace stemvo::apps {

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
  [[nodiscard]] bool is_due(Clock::time_point now, bool is_last) const;

  std::string unit_;
  bool is_quiet_;
  bool is_terminal_;
  Clock::time_point start_;
  Clock::time_point last_;
  /// What the rate is counted from: not what an earlier call had done (--resume).
  std::optional<std::pair<std::size_t, Clock::time_point>> base_;
};

}  // namespace stemvo::apps
