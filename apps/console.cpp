// SPDX-License-Identifier: MIT
#include "console.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <fstream>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <signal.h>
#include <unistd.h>

#include "commands.hpp"
#include "dataset/frame_files.hpp"
#include "report/metrics_json.hpp"

namespace stemvo::apps {
namespace {

bool is_json = false;
bool is_rows = false;

/// On one line: the messages of libraries may have many.
void print_labelled(std::string line, std::string_view message) {
  line += message;
  std::ranges::replace_if(line, [](unsigned char c) { return c < 0x20; }, ' ');
  print_note(line + '\n');
}

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

void print_note(std::string_view text) { std::fwrite(text.data(), 1, text.size(), stderr); }

void print(std::string_view text) {
  if (!is_json) {
    is_rows ? print_note(text) : print_help(text);
  }
}

void print_help(std::string_view text) { std::fwrite(text.data(), 1, text.size(), stdout); }

void choose_json() { is_json = true; }

void choose_rows() {
  is_rows = true;
  std::signal(SIGPIPE, SIG_IGN);  // the results are written all the same
}

bool print_row(const nlohmann::ordered_json& row) {
  print_help(row.dump() + '\n');
  return std::fflush(stdout) == 0;
}

void print_json(const nlohmann::ordered_json& document) {
  if (is_json) {
    print_help(to_text(document));
  }
}

void print_error(std::string_view message) { print_labelled("error: ", message); }

void print_line(std::string_view message) { print_labelled("", message); }

void print_warning(std::string_view message) { print_labelled("warning: ", message); }

int flush_console(int exit_code) {
  const bool is_written = std::fflush(stdout) == 0 && std::ferror(stdout) == 0;
  if (is_written || exit_code != kExitDone) {
    return exit_code;
  }
  print_error("standard output: cannot be written");
  return kExitFailed;
}

std::string command_line() {
  std::ifstream words("/proc/self/cmdline");
  std::string command = "stemvo";
  std::string word;
  std::getline(words, word, '\0');  // the program
  while (std::getline(words, word, '\0')) {
    constexpr const char* kPlain =
        "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-+=./:,@%";
    const bool is_plain = !word.empty() && word.find_first_not_of(kPlain) == std::string::npos;
    for (std::size_t at = 0; (at = word.find('\'', at)) != std::string::npos; at += 4) {
      word.replace(at, 1, "'\\''");
    }
    command += is_plain ? " " + word : " '" + word + "'";
  }
  return dataset::without_secrets(command);
}

std::chrono::steady_clock::time_point process_start() {
  static const auto start = std::chrono::steady_clock::now();
  return start;
}

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
    : unit_(std::move(unit)), is_quiet_(is_quiet), is_terminal_(::isatty(STDERR_FILENO) == 1) {}

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
