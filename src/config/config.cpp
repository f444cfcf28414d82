// SPDX-License-Identifier: MIT
#include "config/config.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "config/config_yaml.hpp"
#include "try.hpp"

namespace stemvo {
namespace {

using options::Rule;

constexpr std::string_view kScaleSource = "scale.source";
constexpr std::string_view kAuto = "auto";
constexpr std::string_view kGroundTruth = "ground_truth";

template <options::Is<Config> C, typename V>
void visit_keys(C& config, V&& v) {
  v("input", "camera", config.input.camera,
    Rule::one_of({"auto", "image_0", "image_1", "image_2", "image_3"}),
    "folder of the sequence to read; auto: image_2 (colour) where present, else image_0 (gray)");
  v("evaluation", "segment_lengths_m", config.evaluation.segment_lengths_m,
    Rule::between(0.01, 1e6),
    "lengths of the segments of t_rel and r_rel; []: 100, 200, .. 800, or 10, 20, .. 50 where the "
    "path is under 100 m");
  options::visit(config, v);
}

/// Nothing, or why the value is none of the program's.
std::string read_scale_source(Config& config, const YAML::Node& node) {
  std::vector<std::string_view> names = {kAuto, kGroundTruth};
  names.insert(names.begin() + 1, options::kNames<ScaleSource>.begin(),
               options::kNames<ScaleSource>.end());
  std::string name;
  std::string problem = config::parse(node, name);
  problem = problem.empty() ? options::violation_of(name, Rule::one_of(names)) : problem;
  if (problem.empty()) {
    config.scale_choice = name == kAuto          ? ScaleChoice::kAuto
                          : name == kGroundTruth ? ScaleChoice::kGroundTruth
                                                 : ScaleChoice::kOptions;
    config.scale.source = config.scale_choice == ScaleChoice::kOptions
                              ? options::from_string<ScaleSource>(name)
                              : ScaleSource::kNone;
  }
  return problem;
}

std::vector<config::Key> keys_of(Config& config) {
  std::vector<config::Key> keys;
  visit_keys(config,
             [&keys](std::string_view section, std::string_view key, auto& value, const Rule& rule,
                     std::string_view /*help*/) { keys.emplace_back(section, key, value, rule); });
  const auto source = std::ranges::find(keys, kScaleSource, &config::Key::name);
  source->read = [&config](const YAML::Node& node) { return read_scale_source(config, node); };
  return keys;
}

}  // namespace

Expected<Config> load_config(const std::filesystem::path& file) {
  STEMVO_TRY_GET(const auto root, config::read_document(file));
  Config result;
  result.file = file;
  std::vector<config::Key> keys = keys_of(result);
  STEMVO_TRY(config::read_map(root, "", file.string(), keys));
  for (const config::Key& key : keys) {
    if (key.is_given) {
      result.keys_in_file.insert(key.name());
    }
  }
  return result;
}

Status apply_override(Config& config, const std::string& assignment) {
  const std::size_t equals = assignment.find('=');
  if (equals == std::string::npos) {
    return fail(fmt::format("--set {}: expected key=value, as in stem.filter=10", assignment));
  }
  const std::string name = assignment.substr(0, equals);
  const std::size_t dot = name.find('.');
  const std::string section = dot == std::string::npos ? "" : name.substr(0, dot);
  std::vector<config::Key> keys = keys_of(config);
  const std::string problem = config::read_key(section, name.substr(section.empty() ? 0 : dot + 1),
                                               YAML::Node(assignment.substr(equals + 1)), keys);
  if (!problem.empty()) {
    return fail("--set " + name + ": " + problem);
  }
  config.keys_overridden.insert(name);
  return {};
}

Status validate(const Config& config) {
  options::Checker checker;
  visit_keys(config, checker);
  return checker.status ? validate(static_cast<const Options&>(config)) : checker.status;
}

std::string_view scale_source(const Config& config) {
  return config.scale_choice == ScaleChoice::kGroundTruth ? kGroundTruth
         : config.scale_choice == ScaleChoice::kAuto && config.scale.source == ScaleSource::kNone
             ? kAuto
             : options::to_string(config.scale.source);
}

std::string dump_config(const Config& config) {
  std::string text;
  std::string_view last_section;
  visit_keys(config, [&](std::string_view section, std::string_view key, const auto& value,
                         const Rule& /*rule*/, std::string_view help) {
    if (section != last_section) {
      last_section = section;
      text += text.empty() ? "" : "\n";
      text += section.empty() ? "" : fmt::format("{}:\n", section);
    }
    const bool is_source = options::full_name(section, key) == kScaleSource;
    text += fmt::format("{0}# {1}\n{0}{2}: {3}\n", section.empty() ? "" : "  ", help, key,
                        is_source ? std::string(scale_source(config)) : config::format(value));
  });
  return text;
}

}  // namespace stemvo
