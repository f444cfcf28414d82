// SPDX-License-Identifier: MIT
#include "options.hpp"

#include <map>
#include <system_error>
#include <type_traits>

#include <fmt/format.h>

#include "text/text_file.hpp"
#include "try.hpp"

namespace stemvo::apps {
namespace {

constexpr const char* kShippedConfigs = "default, fast, paper";

/// The program's configurations stand in <prefix>/share/stemvo/config of the prefix that
/// it is installed under, else that of the source tree it was built from.
std::filesystem::path config_folder() {
  std::error_code code;
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", code);
  const auto installed = program.parent_path().parent_path() / "share/stemvo/config";
  return !code && is_folder(installed) ? installed
                                       : std::filesystem::path(STEMVO_SOURCE_DIR) / "config";
}

Expected<std::filesystem::path> find_config(const std::string& given) {
  const std::filesystem::path file(given);
  if (is_there(file) || file.has_parent_path()) {
    return file;
  }
  for (const std::string& name : {given, given + ".yaml"}) {
    const std::filesystem::path shipped = config_folder() / name;
    if (is_there(shipped)) {
      return shipped;
    }
  }
  return fail(given +
              ": expected a configuration file, or the name of one that comes with stemvo (" +
              kShippedConfigs + "), found neither");
}

}  // namespace

template <typename Number>
CLI::Validator in_range(Number min, Number max) {
  const auto check = [min, max](const std::string& text) {
    Number value = {};
    const bool is_inside =
        CLI::detail::lexical_cast(text, value) && value >= min && value <= max;  // nan is not
    return is_inside ? std::string()
                     : fmt::format("expected a {} from {} to {}, found {}",
                                   std::is_integral_v<Number> ? "whole number" : "number", min, max,
                                   text);
  };
  return {check, ""};
}
template CLI::Validator in_range(int, int);
template CLI::Validator in_range(double, double);

void add_config_options(CLI::App& command, ConfigArguments& arguments) {
  command
      .add_option("--config", arguments.file,
                  std::string("Configuration file, or the name of one that comes with stemvo: ") +
                      kShippedConfigs)
      ->type_name("FILE");
  command
      .add_option("--set", arguments.overrides,
                  "Set one configuration key, e.g. stem.filter=3; may be given many times")
      ->type_name("KEY=VALUE")
      ->allow_extra_args(false)
      ->check([](const std::string& text) {
        return text.find('=') == std::string::npos ? "expected KEY=VALUE, found '" + text + "'"
                                                   : std::string();
      });
}

Expected<Config> read_config(const ConfigArguments& arguments) {
  Config config;
  if (!arguments.file.empty()) {
    STEMVO_TRY_GET(const auto file, find_config(arguments.file));
    STEMVO_TRY_GET(config, load_config(file));
  }
  std::map<std::string, std::string> given;  // key -> the assignment
  for (const std::string& assignment : arguments.overrides) {
    const auto [before, is_new] =
        given.emplace(assignment.substr(0, assignment.find('=')), assignment);
    if (!is_new) {
      return fail("--set " + before->first + ": expected once, found '" + before->second +
                  "' and '" + assignment + "'");
    }
    STEMVO_TRY(apply_override(config, assignment));
  }
  STEMVO_TRY(validate(config));
  return config;
}

CLI::Option* add_file_option(CLI::App& command,
                             const std::string& name,
                             std::optional<std::filesystem::path>& file,
                             const std::string& help) {
  const auto take = [&file, name](const std::string& text) {
    if (text.starts_with("--")) {
      throw CLI::ValidationError(name, "expected a file, found " + text);
    }
    if (!text.empty()) {
      file = text;
    }
  };
  return command.add_option_function<std::string>(name, take, help)->type_name("FILE");
}

CLI::Option* add_rate_option(CLI::App& command, std::optional<double>& rate_hz) {
  return command
      .add_option("--rate", rate_hz,
                  "Of frames without times: frames per second, where the camera file has no "
                  "rate_hz; default 30")
      ->type_name("HZ")
      ->check(in_range(1e-6, 1e5));
}

void add_tolerance_option(CLI::App& command, double& tolerance_s) {
  command
      .add_option("--gt-tolerance", tolerance_s,
                  "Most seconds between a frame and its true pose; default 0.01")
      ->type_name("S")
      ->check(in_range(0.0, 3600.0));
}

CLI::Option* add_range_option(CLI::App& command,
                              const std::string& name,
                              std::optional<FrameRangeRequest>& range,
                              const std::string& help) {
  const auto parse = [&range](const std::string& text) {
    const Expected<FrameRangeRequest> parsed = parse_frame_range(text);
    if (!parsed) {
      return parsed.error().message;
    }
    range = *parsed;
    return std::string();
  };
  // The validator does the work, so that a malformed range is CLI11's wrong usage.
  return command.add_option_function<std::string>(
                    name, [](const std::string&) {}, help)
      ->type_name("A:B")
      ->check(parse);
}

}  // namespace stemvo::apps
