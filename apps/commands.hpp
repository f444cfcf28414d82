// SPDX-License-Identifier: MIT
#pragma once

#include <functional>
#include <memory>

#include <CLI/CLI.hpp>

#include "stemvo/error.hpp"

namespace stemvo::apps {

inline constexpr int kExitDone = 0;
inline constexpr int kExitFailed = 1;  ///< the world disagreed
inline constexpr int kExitUsage = 2;
inline constexpr int kExitInterrupted = 130;

/// The work that the command line asks for; set while parsing, called afterwards. Returns the exit
/// code; an error is printed, and means kExitFailed.
using Action = std::function<Expected<int>()>;

struct CommandText {
  const char* name;
  const char* what;    ///< one line
  const char* footer;  ///< below the options
};
/// A command whose options fill an `Arguments`, which lives as long as it, for `run`.
template <typename Arguments>
CLI::App* add_command(CLI::App& app,
                      Action& action,
                      const CommandText& text,
                      void (*add_options)(CLI::App&, Arguments&),
                      Expected<int> (*run)(Arguments&)) {
  CLI::App* command = app.add_subcommand(text.name, text.what);
  const auto arguments = std::make_shared<Arguments>();
  add_options(*command, *arguments);
  command->footer(text.footer);
  command->callback(
      [arguments, run, &action] { action = [arguments, run] { return run(*arguments); }; });
  return command;
}

/// Each adds its command, whose parsing sets `action`.
CLI::App* add_run(CLI::App& app, Action& action);
CLI::App* add_evaluate(CLI::App& app, Action& action);
CLI::App* add_channel(CLI::App& app, Action& action);
CLI::App* add_synth(CLI::App& app, Action& action);
CLI::App* add_calibrate(CLI::App& app, Action& action);
CLI::App* add_check(CLI::App& app, Action& action);
CLI::App* add_models(CLI::App& app, Action& action);

}  // namespace stemvo::apps
