// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "evaluation/metrics.hpp"
#include "stemvo/error.hpp"
#include "stemvo/options.hpp"

namespace stemvo {

/// Keys `input.*`.
struct InputOptions {
  std::string camera = "auto";
};

/// What the program reads from YAML; config/default.yaml is generated from the defaults.
struct Config : Options {
  InputOptions input;
  EvaluationOptions evaluation;
};

/// Reads a YAML file over `base`. Errors with file and line: not YAML, unknown or duplicated key,
/// wrong type, value out of range.
[[nodiscard]] Expected<Config> load_config(const std::filesystem::path& file,
                                           const Config& base = {});
/// The keys a YAML file sets, e.g. "scale.source". Errors: it cannot be read, it is not YAML.
[[nodiscard]] Expected<std::vector<std::string>> keys_in_config(const std::filesystem::path& file);
/// `key=value` of --set, e.g. "stem.filter=10".
[[nodiscard]] Status apply_override(Config& config, const std::string& assignment);
/// Ranges and choices of every key; written so that NaN fails.
[[nodiscard]] Status validate(const Config& config);
/// YAML with every key, exact (numbers round-trip).
[[nodiscard]] std::string dump_config(const Config& config);

}  // namespace stemvo
