// SPDX-License-Identifier: MIT
#include "config/config.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "config/config_yaml.hpp"
#include "text/text_file.hpp"

namespace stemvo {
namespace {

using options::Field;

/// Those of the library, and the program's own before and after them.
std::vector<Field> fields_of(Config& config) {
  std::vector<Field> fields = options::fields_of(config);
  fields.insert(
      fields.begin(),
      {"input", "camera", &config.input.camera,
       options::Rule::one_of({"auto", "image_0", "image_1", "image_2", "image_3"}),
       "folder of the sequence to read; auto: image_2 (colour) where present, else image_0 "
       "(gray)"});
  fields.insert(
      fields.end() - 1,  // the seed is last
      {"evaluation", "segment_lengths_m", &config.evaluation.segment_lengths_m,
       options::Rule::between(0.01, 1e6),
       "of t_rel and r_rel; []: 100, 200, .. 800, or 10, 20, .. 50 where the path is under "
       "100 m"});
  return fields;
}

}  // namespace

Expected<Config> load_config(const std::filesystem::path& file, const Config& base) {
  const auto root = read_text_file(file, kMaxSettings_MB).and_then([&](const std::string& text) {
    return config::parse_document(text, file.string());
  });
  if (!root) {
    return root.error();
  }
  Config result = base;
  result.file = file;
  std::vector<Field> fields = fields_of(result);
  if (Status status = config::read_document(*root, file.string(), fields); !status) {
    return status.error();
  }
  for (const Field& field : fields) {
    if (field.is_given) {
      result.keys_in_file.insert(field.name());
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
  const std::string source = "--set " + name;
  Config changed = config;
  const std::vector<Field> fields = fields_of(changed);
  const auto field = std::find_if(fields.begin(), fields.end(),
                                  [&name](const Field& f) { return f.name() == name; });
  if (field == fields.end()) {
    const std::string section = name.substr(0, name.find('.'));
    return fail(source + ": " +
                config::unknown_key(section, name.substr(name.find('.') + 1), fields));
  }
  const std::string problem = config::read_assigned(assignment.substr(equals + 1), *field);
  if (!problem.empty()) {
    return fail(source + ": " + problem);
  }
  config = std::move(changed);
  config.keys_overridden.insert(name);
  return {};
}

Status validate(const Config& config) {
  Config copy = config;
  const Status status = options::check(fields_of(copy));
  return status ? validate(static_cast<const Options&>(config)) : status;
}

std::string dump_config(const Config& config) {
  Config copy = config;
  std::string text;
  std::string_view section;
  for (const Field& field : fields_of(copy)) {
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

}  // namespace stemvo
