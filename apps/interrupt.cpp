// SPDX-License-Identifier: MIT
#include "interrupt.hpp"

#include <csignal>

#include <signal.h>

namespace stemvo::apps {
namespace {

volatile std::sig_atomic_t interrupted = 0;

void on_signal(int /*number*/) { interrupted = 1; }

}  // namespace

void catch_interrupts() {
  struct sigaction action = {};
  action.sa_handler = on_signal;
  action.sa_flags = static_cast<int>(SA_RESETHAND | SA_RESTART);
  sigemptyset(&action.sa_mask);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

bool is_interrupted() { return interrupted != 0; }

}  // namespace stemvo::apps
