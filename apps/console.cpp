// SPDX-License-Identifier: MIT
#include "console.hpp"

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <fstream>
#include <new>
#include <string>
#include <system_error>

#include <execinfo.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <opencv2/core.hpp>
#include <unistd.h>

#include "commands.hpp"
#include "report/metrics_keys.hpp"

namespace stemvo::apps {
namespace {

constexpr const char* kNoThreads =
    "out of threads: expected more than 'ulimit -u' allows, or more memory for them";
constexpr const char* kNoMemory =
    "out of memory: expected more than there is, or than 'ulimit -v' allows";

std::FILE* console = stderr;  // ours; `stderr` is what libraries print to
int first_failure = 0;        // errno of the first write to standard output that failed
bool is_json = false;

void write_out(std::string_view text) {
  if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size() && first_failure == 0) {
    first_failure = errno;
  }
}

void print_labelled(std::string_view label, std::string_view message) {
  std::string line = label.empty() ? std::string(message) : fmt::format("{}: {}", label, message);
  for (char& c : line) {
    c = static_cast<unsigned char>(c) < 0x20 ? ' ' : c;  // libraries' messages may be many lines
  }
  line += '\n';
  print_note(line);
}

/// Whatever ends the program says so.
[[noreturn]] void on_terminate() {
  const std::string what = describe(std::current_exception());
  print_error(what);
  if (what.starts_with("internal")) {
    std::abort();
  }
  std::_Exit(kExitFailed);
}

}  // namespace

std::string describe(const std::exception_ptr& error) {
  try {
    std::rethrow_exception(error);
  } catch (const std::bad_alloc&) {
    return kNoMemory;
  } catch (const cv::Exception& opencv) {
    return opencv.code == cv::Error::StsNoMem ? kNoMemory
                                              : std::string("internal: ") + opencv.what();
  } catch (const std::system_error& system) {
    return system.code() == std::errc::resource_unavailable_try_again ? kNoThreads : system.what();
  } catch (const std::exception& other) {  // ONNX Runtime's say it in words only
    return std::string_view(other.what()).find("pthread_create") != std::string_view::npos
               ? kNoThreads
               : std::string("internal: ") + other.what();
  } catch (...) {
    return "internal: unknown exception";
  }
}

void prepare_console() {
  // The C library loads what unwinds the stack at its first use, which may be where memory has run
  // out (backtrace(3), notes): from here on it is there.
  void* frame = nullptr;
  backtrace(&frame, 1);
  // A file opened while descriptor 1 is closed would become standard output. Only to be read: what
  // is printed there fails.
  int descriptor = 0;
  do {
    descriptor = ::open("/dev/null", O_RDONLY);
  } while (descriptor >= 0 && descriptor <= STDERR_FILENO);
  if (descriptor >= 0) {
    ::close(descriptor);
  }
  std::signal(SIGPIPE, SIG_IGN);
  std::set_terminate(on_terminate);
#ifdef __GLIBC__  // where the manual says that the variable may be set
  if (std::FILE* const nowhere = std::fopen("/dev/null", "we")) {
    stderr = nowhere;
  }
#endif
}

void print_note(std::string_view text) { std::fwrite(text.data(), 1, text.size(), console); }

void print(std::string_view text) {
  if (!is_json) {
    write_out(text);
  }
}

void print_help(std::string_view text) { write_out(text); }

void choose_json() { is_json = true; }

void print_json(const nlohmann::ordered_json& document) {
  if (is_json) {
    write_out(to_text(document));
  }
}

void print_error(std::string_view message) { print_labelled("error", message); }

void print_line(std::string_view message) { print_labelled("", message); }

void print_warning(std::string_view message) { print_labelled("warning", message); }

int flush_console(int exit_code) {
  if (std::fflush(stdout) != 0 && first_failure == 0) {
    first_failure = errno;
  }
  if (first_failure == 0 || first_failure == EPIPE || exit_code != kExitDone) {
    return exit_code;
  }
  print_error(fmt::format("standard output: cannot be written ({})",
                          std::generic_category().message(first_failure)));
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
  return command;
}

std::chrono::steady_clock::time_point process_start() {
  static const auto start = std::chrono::steady_clock::now();
  return start;
}

}  // namespace stemvo::apps
