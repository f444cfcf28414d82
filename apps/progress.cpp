// SPDX-License-Identifier: MIT
#include "progress.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <csignal>
#include <utility>

#include <fmt/format.h>
#include <signal.h>
#include <unistd.h>

#include "console.hpp"

namespace stemvo::apps {
namespace {

// Lock-free, so a signal handler may set it; read by whichever thread shows the progress.
std::atomic<bool> interrupted = false;
static_assert(std::atomic<bool>::is_always_lock_free);

void on_signal(int /*number*/) { interrupted = true; }

std::string describe_time(double seconds) {
  const auto whole = std::lround(seconds);
  return whole < 60 ? fmt::format("{} s", whole)
                    : fmt::format("{} min {:02} s", whole / 60, whole % 60);
}

}  // namespace

void catch_interrupts() {
  struct sigaction action = {};
  action.sa_handler = on_signal;
  action.sa_flags = static_cast<int>(SA_RESETHAND | SA_RESTART);
  sigemptyset(&action.sa_mask);
  for (const int number : {SIGINT, SIGTERM}) {
    sigaction(number, &action, nullptr);
  }
}

bool is_interrupted() { return interrupted; }

Progress::Progress(std::string unit, bool is_quiet)
    : unit_(std::move(unit)),
      is_quiet_(is_quiet),
      is_terminal_(::isatty(STDERR_FILENO) == 1),
      start_(Clock::now()),
      last_(start_) {}

bool Progress::operator()(std::size_t done, std::size_t total) {
  const bool go_on = !is_interrupted();
  const bool is_last = done == total || !go_on;
  const Clock::time_point now = Clock::now();
  const std::chrono::duration<double> since_last = now - last_;
  const double period_s = is_terminal_ ? 0.1 : 5.0;
  if (!is_quiet_ && (is_last || since_last.count() >= period_s)) {
    print_note(line(done, total, std::chrono::duration<double>(now - start_).count(), is_last));
    last_ = now;
  }
  return go_on;
}

std::string Progress::line(std::size_t done,
                           std::size_t total,
                           double elapsed_s,
                           bool is_last) const {
  const double per_s = static_cast<double>(done) / std::max(elapsed_s, 1e-9);
  const std::string of = total == 0 ? "" : fmt::format("/{}", total);
  const std::string time = is_last ? describe_time(elapsed_s) + " in all"
                           : total == 0
                               ? describe_time(elapsed_s) + " so far"
                               : describe_time(static_cast<double>(total - done) / per_s) + " left";
  const std::string text =
      fmt::format("{}{} {}, {:.1f} {}/s, {}", done, of, unit_, per_s, unit_, time);
  // \r and "erase to the end" keep a terminal's cursor on one line until the last.
  return is_terminal_ ? "\r" + text + "\x1b[K" + (is_last ? "\n" : "") : text + "\n";
}

}  // namespace stemvo::apps
