// SPDX-License-Identifier: MIT
#include "stemvo/config.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <iterator>
#include <system_error>

#include <fmt/format.h>

#include "config/config_fields.hpp"
#include "config/config_text.hpp"
#include "config/config_yaml.hpp"

namespace stemvo {
namespace {

constexpr int kWideFrame_px = 1000;

Expected<std::string> read_text(const std::filesystem::path& file) {
  std::error_code error;
  if (std::filesystem::is_directory(file, error)) {
    return fail(fmt::format("{}: expected a configuration file, found a folder", file.string()));
  }
  std::ifstream in(file, std::ios::binary);
  if (!in) {
    return fail(fmt::format("{}: expected a configuration file, found none that can be read ({})",
                            file.string(), std::strerror(errno)));
  }
  return std::string(std::istreambuf_iterator<char>(in), {});
}

Expected<YAML::Node> read_yaml(const std::filesystem::path& file) {
  return read_text(file).and_then(
      [&](const std::string& text) { return config::parse_document(text, file.string()); });
}

/// A list is written as in the file; anything else is taken as it stands, so that a path may hold
/// any character.
std::string read_assigned(const std::string& text, const config::Field& field) {
  if (!std::holds_alternative<std::vector<double>*>(field.value)) {
    const std::string problem = config::parse_scalar(field, text);
    return problem.empty() ? config::violation_of(field) : problem;
  }
  const Expected<YAML::Node> value = config::parse_document(text, "value");
  return value ? config::read_value(*value, field) : value.error().message;
}

}  // namespace

Expected<Config> load_config(const std::filesystem::path& file, const Config& base) {
  const Expected<YAML::Node> root = read_yaml(file);
  if (!root) {
    return root.error();
  }
  Config result = base;
  std::vector<config::Field> fields = config::fields_of(result);
  if (Status status = config::read_document(*root, file.string(), fields); !status) {
    return status.error();
  }
  return result;
}

Expected<std::vector<std::string>> keys_in_config(const std::filesystem::path& file) {
  const Expected<YAML::Node> root = read_yaml(file);
  if (!root) {
    return root.error();
  }
  Config config;
  std::vector<std::string> keys;
  for (const config::Field& field : config::fields_of(config)) {
    if (config::is_set(*root, field)) {
      keys.push_back(field.name());
    }
  }
  return keys;
}

Status apply_override(Config& config, const std::string& assignment) {
  const std::size_t equals = assignment.find('=');
  if (equals == std::string::npos) {
    return fail(fmt::format("--set {}: expected key=value, as in stem.filter=10", assignment));
  }
  const std::string name = assignment.substr(0, equals);
  const std::string source = "--set " + name;
  Config changed = config;
  const std::vector<config::Field> fields = config::fields_of(changed);
  const auto field = std::find_if(fields.begin(), fields.end(),
                                  [&name](const config::Field& f) { return f.name() == name; });
  if (field == fields.end()) {
    const std::string section = name.substr(0, name.find('.'));
    const bool is_section = std::any_of(fields.begin(), fields.end(),
                                        [&](const auto& f) { return f.section == section; });
    return fail(source + ": " + config::unknown_key(is_section ? section : "", fields));
  }
  const std::string problem = read_assigned(assignment.substr(equals + 1), *field);
  if (!problem.empty()) {
    return fail(source + ": " + problem);
  }
  config = changed;
  return {};
}

Status validate(const Config& config) {
  Config copy = config;
  for (const config::Field& field : config::fields_of(copy)) {
    if (const std::string problem = config::violation_of(field); !problem.empty()) {
      return fail(field.name() + ": " + problem);
    }
  }
  if (!(config.stem.stretch_low_percent < config.stem.stretch_high_percent)) {
    return fail(fmt::format(
        "stem.stretch_low_percent: expected less than stem.stretch_high_percent ({}), found {}",
        config.stem.stretch_high_percent, config.stem.stretch_low_percent));
  }
  return {};
}

std::string dump_config(const Config& config) {
  Config copy = config;
  std::string text;
  std::string_view section;
  for (const config::Field& field : config::fields_of(copy)) {
    if (field.section != section) {
      section = field.section;
      text += section.empty() ? "\n" : fmt::format("{}{}:\n", text.empty() ? "" : "\n", section);
    }
    const std::string_view indent = section.empty() ? "" : "  ";
    text += fmt::format("{0}# {1}\n{0}{2}: {3}\n", indent, field.help, field.key,
                        config::format_value(field));
  }
  return text;
}

Config with_chosen_upsample(Config config, int width_px) {
  if (config.stem.upsample == "auto") {
    config.stem.upsample =
        config.features.method == "klt" && width_px >= kWideFrame_px ? "half" : "bicubic";
  }
  return config;
}

}  // namespace stemvo
