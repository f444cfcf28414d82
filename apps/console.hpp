// SPDX-License-Identifier: MIT
#pragma once

#include <chrono>
#include <exception>
#include <string>
#include <string_view>

#include <nlohmann/json_fwd.hpp>

namespace stemvo::apps {

/// Keeps files away from a closed standard output (to print there is an error), a closed pipe from
/// ending the program, and what libraries print (libpng, libjpeg) from standard error, which is
/// ours; what ends the program says so.
void prepare_console();

/// What an exception that nobody caught means: what ran out (memory, threads, open files), else
/// "internal: ..", a bug of ours.
[[nodiscard]] std::string describe(const std::exception_ptr& error);

/// Results for people, to standard output; nothing with --json. A failure is told by flush_console.
void print(std::string_view text);
/// Help and version, also with --json.
void print_help(std::string_view text);
/// --json: what print_json gets is all of standard output.
void choose_json();
/// A command's result as one document; nothing without --json. Once, and not after an error.
void print_json(const nlohmann::ordered_json& document);
/// "error: ..." on one line of standard error.
void print_error(std::string_view message);
/// "warning: ..." on one line of standard error.
void print_warning(std::string_view message);

/// A line of standard error that is neither.
void print_line(std::string_view message);
/// To standard error as it is.
void print_note(std::string_view text);

/// Flushes standard output; the exit code, or 1 with a message when the results could not be
/// written there (a reader that went away is no failure).
int flush_console(int exit_code);

/// What the user typed, for a POSIX shell, with `stemvo` for the program.
std::string command_line();

/// When the process started; the first call sets it.
std::chrono::steady_clock::time_point process_start();

}  // namespace stemvo::apps
