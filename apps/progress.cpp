// SPDX-License-Identifier: MIT
#include "progress.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "console.hpp"
#include "interrupt.hpp"

namespace stemvo::apps {
namespace {

constexpr double kTerminalPeriod_s = 0.1;
constexpr double kPlainPeriod_s = 5.0;

std::string describe_time(double seconds) {
  const auto whole = std::lround(seconds);
  return whole < 60 ? fmt::format("{} s", whole)
                    : fmt::format("{} min {:02} s", whole / 60, whole % 60);
}

/// Of the terminal; 0: not known.
std::size_t num_columns() {
  winsize size{};
  return ::ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 ? size.ws_col : 0;
}

/// A line that stays one in the terminal: with a bar where there is room for it, without its last
/// parts where there is too little.
std::string fitted(std::string text, double share) {
  constexpr std::size_t kMinBar = 10;
  constexpr std::size_t kMaxBar = 30;
  const std::size_t columns = num_columns();
  if (columns == 0) {
    return text;
  }
  for (std::size_t end = text.rfind(", "); text.size() >= columns && end != std::string::npos;
       end = text.rfind(", ")) {
    text.resize(end);
  }
  const std::size_t room = columns - 1 > text.size() + 3 ? columns - 1 - text.size() - 3 : 0;
  if (room >= kMinBar && share >= 0.0) {
    const std::size_t bar = std::min(room, kMaxBar);
    const auto full = static_cast<std::size_t>(share * static_cast<double>(bar));
    return fmt::format("[{:=<{}}{:{}}] {}", "", full, "", bar - full, text);
  }
  return text.substr(0, columns - 1);
}

}  // namespace

Progress::Progress(std::string unit, bool is_quiet)
    : unit_(std::move(unit)),
      is_quiet_(is_quiet),
      is_terminal_(::isatty(STDERR_FILENO) == 1),
      start_(Clock::now()),
      last_(start_) {}

bool Progress::is_due(Clock::time_point now, bool is_last) const {
  const std::chrono::duration<double> since = now - last_;
  return is_last || since.count() >= (is_terminal_ ? kTerminalPeriod_s : kPlainPeriod_s);
}

bool Progress::operator()(std::size_t done, std::size_t total) {
  const bool go_on = !is_interrupted();
  const Clock::time_point now = Clock::now();
  const bool is_last = done == total || !go_on;
  if (!base_) {
    base_ = done > 1 && !is_last ? std::pair(done, now) : std::pair(std::size_t{0}, start_);
  }
  if (!is_quiet_ && is_due(now, is_last)) {
    const double elapsed_s = std::max(std::chrono::duration<double>(now - start_).count(), 1e-9);
    const bool is_begun = done > base_->first;
    const double since_s = std::chrono::duration<double>(now - base_->second).count();
    const double per_s = is_begun
                             ? static_cast<double>(done - base_->first) / std::max(since_s, 1e-9)
                             : static_cast<double>(done) / elapsed_s;
    const std::string rest =
        is_last      ? fmt::format("{} in all", describe_time(elapsed_s))
        : total == 0 ? describe_time(elapsed_s) + " so far"
                     : describe_time(static_cast<double>(total - done) / per_s) + " left";
    const std::string of = total == 0 ? "" : fmt::format("/{}", total);
    const std::string text =
        fmt::format("{}{} {}, {:.1f} {}/s, {}", done, of, unit_, per_s, unit_, rest);
    // \r and "erase to the end" keep a terminal's cursor on one line until the last.
    const double share = total == 0 ? -1.0 : static_cast<double>(done) / static_cast<double>(total);
    const std::string line =
        is_terminal_ ? "\r" + fitted(text, share) + "\x1b[K" + (is_last ? "\n" : "") : text + "\n";
    print_note(line);
    last_ = now;
  }
  return go_on;
}

}  // namespace stemvo::apps
