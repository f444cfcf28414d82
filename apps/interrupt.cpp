// SPDX-License-Identifier: MIT
#include "interrupt.hpp"

#include <atomic>
#include <csignal>
#include <string_view>

#include <signal.h>
#include <unistd.h>

#include "commands.hpp"

namespace stemvo::apps {
namespace {

// Lock-free, so a signal handler may set it; read by whichever thread shows the progress.
std::atomic<bool> interrupted = false;
static_assert(std::atomic<bool>::is_always_lock_free);

void on_signal(int /*number*/) { interrupted = true; }

/// What a graph's Div or Mod makes of the least number and -1: ONNX Runtime looks for 0 only.
void on_division(int /*number*/) {
  constexpr std::string_view kMessage =
      "error: a division of whole numbers that has no result: the model cannot be used\n";
  [[maybe_unused]] const auto written = ::write(STDERR_FILENO, kMessage.data(), kMessage.size());
  ::_exit(kExitFailed);
}

}  // namespace

void catch_interrupts() {
  struct sigaction action = {};
  action.sa_handler = on_signal;
  action.sa_flags = static_cast<int>(SA_RESETHAND | SA_RESTART);
  sigemptyset(&action.sa_mask);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  std::signal(SIGFPE, on_division);
  std::signal(SIGXFSZ, SIG_IGN);  // a limit of file size is an error of the write, as a full disk
  struct sigaction before = {};
  sigaction(SIGHUP, nullptr, &before);
  if (before.sa_handler != SIG_IGN) {     // as nohup asks for
    sigaction(SIGHUP, &action, nullptr);  // a connection that is lost
  }
}

bool is_interrupted() { return interrupted; }

}  // namespace stemvo::apps
