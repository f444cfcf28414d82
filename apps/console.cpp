// SPDX-License-Identifier: MIT
#include "console.hpp"

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <fstream>

#include <nlohmann/json.hpp>

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

}  // namespace stemvo::apps
