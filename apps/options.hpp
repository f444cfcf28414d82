// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "config/config.hpp"
#include "dataset/frame_source.hpp"
#include "stemvo/error.hpp"

namespace stemvo::apps {

/// --config and --set, which several commands share.
struct ConfigArguments {
  std::string file;
  std::vector<std::string> overrides;
};
void add_config_options(CLI::App& command, ConfigArguments& arguments);

/// Defaults, then the file, then each --set (a key twice is an error), then the checks of the
/// whole. A file that is not there as given and has no folder in its name is looked up among the
/// configurations that come with the program, with or without ".yaml".
[[nodiscard]] Expected<Config> read_config(const ConfigArguments& arguments);

/// An option FILE; without text it counts as not given.
CLI::Option* add_file_option(CLI::App& command,
                             const std::string& name,
                             std::optional<std::filesystem::path>& file,
                             const std::string& help);

/// Numbers from min to max, so finite ones, or int: whole ones; leaves the help's line short.
template <typename Number>
[[nodiscard]] CLI::Validator in_range(Number min, Number max);

CLI::Option* add_rate_option(CLI::App& command, std::optional<double>& rate_hz);

void add_tolerance_option(CLI::App& command, double& tolerance_s);

/// An option "A:B"; text of another form is wrong usage.
CLI::Option* add_range_option(CLI::App& command,
                              const std::string& name,
                              std::optional<FrameRangeRequest>& range,
                              const std::string& help);

}  // namespace stemvo::apps
