// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <set>
#include <string>

#include "evaluation/metrics.hpp"
#include "stemvo/error.hpp"
#include "stemvo/options.hpp"

namespace stemvo {

/// Keys `input.*`.
struct InputOptions {
  std::string camera = "auto";
};

/// The program's configuration, read from YAML; config/default.yaml is generated from the defaults.
struct Config : Options {
  InputOptions input;
  EvaluationOptions evaluation;

  std::filesystem::path file;  ///< that load_config read; empty: none

  // Keys that somebody chose, e.g. "scale.source".
  std::set<std::string> keys_in_file;     ///< of load_config
  std::set<std::string> keys_overridden;  ///< of apply_override
};

/// Reads a YAML file over `base`. Errors with file and line: not YAML, unknown or duplicated key,
/// wrong type, value out of range.
[[nodiscard]] Expected<Config> load_config(const std::filesystem::path& file,
                                           const Config& base = {});
/// `key=value` of --set, e.g. "stem.filter=10".
[[nodiscard]] Status apply_override(Config& config, const std::string& assignment);
/// Ranges and choices of every key; written so that NaN fails.
[[nodiscard]] Status validate(const Config& config);
/// YAML with every key, exact (numbers round-trip).
[[nodiscard]] std::string dump_config(const Config& config);

}  // namespace stemvo
