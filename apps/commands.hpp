// SPDX-License-Identifier: MIT
#pragma once

#include <functional>

#include <CLI/CLI.hpp>

#include "stemvo/error.hpp"

namespace stemvo::apps {

inline constexpr int kExitDone = 0;
inline constexpr int kExitFailed = 1;  ///< the world disagreed
inline constexpr int kExitUsage = 2;
inline constexpr int kExitInterrupted = 130;

/// What the command line asks for; set while parsing, called afterwards. Returns the exit code; an
/// error is printed, and means kExitFailed.
using Action = std::function<Expected<int>()>;

/// Each adds its command, whose parsing sets `action`.
CLI::App* add_run(CLI::App& app, Action& action);
CLI::App* add_evaluate(CLI::App& app, Action& action);
CLI::App* add_channel(CLI::App& app, Action& action);
CLI::App* add_synth(CLI::App& app, Action& action);
CLI::App* add_calibrate(CLI::App& app, Action& action);
CLI::App* add_check(CLI::App& app, Action& action);
CLI::App* add_benchmark(CLI::App& app, Action& action);
CLI::App* add_robustness(CLI::App& app, Action& action);
CLI::App* add_search(CLI::App& app, Action& action);
CLI::App* add_models(CLI::App& app, Action& action);

}  // namespace stemvo::apps
