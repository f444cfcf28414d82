// SPDX-License-Identifier: MIT
#pragma once

#include <chrono>
#include <cstddef>
#include <string>
#include <string_view>

#include <nlohmann/json_fwd.hpp>

namespace stemvo::apps {

/// Results for people, to standard output; nothing with --json.
void print(std::string_view text);
/// Help and version, also with --json.
void print_help(std::string_view text);
/// --json: the document of print_json is all of standard output.
void choose_json();
/// --stream: standard output is for print_row alone, print goes to standard error.
void choose_rows();
/// A row for a program that reads along; at once. False: nobody reads any more.
bool print_row(const nlohmann::ordered_json& row);
/// A command's result as one document; nothing without --json. Once, and not after an error.
void print_json(const nlohmann::ordered_json& document);

// On one line of standard error: "error: ...", "warning: ...", neither.
void print_error(std::string_view message);
void print_warning(std::string_view message);
void print_line(std::string_view message);
/// To standard error as it is.
void print_note(std::string_view text);

/// Flushes standard output; the exit code, or 1 with a message when it took not all of the result.
int flush_console(int exit_code);

/// The command as the user typed it, for a POSIX shell, with `stemvo` for the program.
std::string command_line();

/// When the process started; the first call sets it.
std::chrono::steady_clock::time_point process_start();

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
  Clock::time_point start_ = Clock::now();
  Clock::time_point last_ = start_;
};

}  // namespace stemvo::apps
