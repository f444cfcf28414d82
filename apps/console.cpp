// SPDX-License-Identifier: MIT
#include "console.hpp"

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <string>

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include "commands.hpp"

namespace stemvo::apps {
namespace {

int first_failure = 0;  // errno of the first write to standard output that failed

void print_line(std::string_view label, std::string_view message) {
  std::string line = label.empty() ? std::string(message) : fmt::format("{}: {}", label, message);
  for (char& c : line) {
    c = static_cast<unsigned char>(c) < 0x20 ? ' ' : c;  // libraries' messages may be many lines
  }
  line += '\n';
  std::fwrite(line.data(), 1, line.size(), stderr);
}

}  // namespace

void prepare_console() {
  // A file opened while descriptor 1 is closed would become standard output.
  int descriptor = 0;
  do {
    descriptor = ::open("/dev/null", O_RDWR);
  } while (descriptor >= 0 && descriptor <= STDERR_FILENO);
  if (descriptor >= 0) {
    ::close(descriptor);
  }
  std::signal(SIGPIPE, SIG_IGN);
}

void print(std::string_view text) {
  if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size() && first_failure == 0) {
    first_failure = errno;
  }
}

void print_error(std::string_view message) { print_line("error", message); }

void print_note(std::string_view message) { print_line("", message); }

void print_warning(std::string_view message) { print_line("warning", message); }

int flush_console(int exit_code) {
  if (std::fflush(stdout) != 0 && first_failure == 0) {
    first_failure = errno;
  }
  if (first_failure == 0 || first_failure == EPIPE || exit_code != kExitDone) {
    return exit_code;
  }
  print_error(fmt::format("standard output: cannot be written ({})", std::strerror(first_failure)));
  return kExitFailed;
}

std::chrono::steady_clock::time_point process_start() {
  static const auto start = std::chrono::steady_clock::now();
  return start;
}

}  // namespace stemvo::apps
