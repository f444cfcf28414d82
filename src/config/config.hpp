// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <set>
#include <string>
#include <string_view>

#include "evaluation/metrics.hpp"
#include "stemvo/error.hpp"
#include "stemvo/options.hpp"

namespace stemvo {

struct InputOptions {
  std::string camera = "auto";
};

/// Where key scale.source, which has two values more in the program, stands.
enum class ScaleChoice {
  kAuto,         ///< nobody named a source: dataset::with_camera_height chooses
  kOptions,      ///< in Options::scale
  kGroundTruth,  ///< every step of the output is rescaled to its true length
};

/// The program's configuration, read from YAML; config/default.yaml is generated from the defaults.
struct Config : Options {
  InputOptions input;
  EvaluationOptions evaluation;
  ScaleChoice scale_choice = ScaleChoice::kAuto;

  std::filesystem::path file;  ///< that load_config read; empty: none

  // Keys that somebody chose, e.g. "scale.source".
  std::set<std::string> keys_in_file;     ///< of load_config
  std::set<std::string> keys_overridden;  ///< of apply_override
};

/// Reads a YAML file over the defaults. Errors with file and line: not YAML, unknown or duplicated
/// key, wrong type, value out of range.
[[nodiscard]] Expected<Config> load_config(const std::filesystem::path& file);
/// `key=value` of --set, e.g. "stem.filter=10".
[[nodiscard]] Status apply_override(Config& config, const std::string& assignment);
[[nodiscard]] Status validate(const Config& config);
[[nodiscard]] std::string_view scale_source(const Config& config);
/// YAML with every key, exact (numbers round-trip).
[[nodiscard]] std::string dump_config(const Config& config);

}  // namespace stemvo
