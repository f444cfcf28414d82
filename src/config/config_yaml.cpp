// SPDX-License-Identifier: MIT
#include "config/config_yaml.hpp"

#include <algorithm>
#include <map>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "config/config_text.hpp"

namespace stemvo::config {
namespace {

int line_of(const YAML::Node& node) { return node.Mark().line + 1; }

std::string_view kind_of(const YAML::Node& node) {
  switch (node.Type()) {
    case YAML::NodeType::Sequence:
      return "a list";
    case YAML::NodeType::Map:
      return "a group of keys";
    case YAML::NodeType::Scalar:
      return "a value";
    default:
      return "nothing";
  }
}

bool is_section(std::string_view name, const std::vector<Field>& fields) {
  return !name.empty() && std::any_of(fields.begin(), fields.end(),
                                      [name](const Field& f) { return f.section == name; });
}

const Field* find_field(std::string_view section,
                        std::string_view key,
                        const std::vector<Field>& fields) {
  const auto found = std::find_if(fields.begin(), fields.end(), [&](const Field& f) {
    return f.section == section && f.key == key;
  });
  return found == fields.end() ? nullptr : &*found;
}

std::string read_list(const YAML::Node& node, std::vector<double>& values) {
  values.clear();
  for (const YAML::Node& element : node) {
    if (!element.IsScalar()) {
      return fmt::format("expected a list of numbers, found {} in it", kind_of(element));
    }
    double value = 0.0;
    if (std::string problem = parse_number(element.Scalar(), value); !problem.empty()) {
      return problem;
    }
    values.push_back(value);
  }
  return {};
}

/// Walks one YAML map, top level (section empty) or section.
class MapReader {
 public:
  MapReader(std::string_view source, std::vector<Field>& fields)
      : source_(source), fields_(fields) {}

  Status read(const YAML::Node& map, std::string_view section) {
    if (map.IsNull()) {
      return {};  // an empty file, or a section whose keys are all commented out
    }
    if (!map.IsMap()) {
      const std::string where = section.empty() ? "" : fmt::format("{}: ", section);
      return error(map, fmt::format("{}expected keys with values, found {}", where, kind_of(map)));
    }
    std::map<std::string, int> first_line;
    for (const auto& entry : map) {
      if (!entry.first.IsScalar()) {
        return error(entry.first, fmt::format("expected a key, found {}", kind_of(entry.first)));
      }
      const std::string& key = entry.first.Scalar();
      // yaml-cpp keeps both entries of a duplicated key without a word.
      const auto [first, is_new] = first_line.emplace(key, line_of(entry.first));
      if (!is_new) {
        return error(entry.first, fmt::format("{}: duplicated key; it stands on line {} already",
                                              full_name(section, key), first->second));
      }
      if (Status status = read_entry(entry.first, entry.second, section); !status) {
        return status;
      }
    }
    return {};
  }

 private:
  Status read_entry(const YAML::Node& key_node, const YAML::Node& value, std::string_view section) {
    const std::string& key = key_node.Scalar();
    if (section.empty() && is_section(key, fields_)) {
      return read(value, key);
    }
    const Field* field = find_field(section, key, fields_);
    const std::string problem =
        field == nullptr ? unknown_key(section, fields_) : read_value(value, *field);
    if (!problem.empty()) {
      return error(key_node, fmt::format("{}: {}", full_name(section, quoted_key(key)), problem));
    }
    return {};
  }

  static std::string full_name(std::string_view section, const std::string& key) {
    return section.empty() ? key : fmt::format("{}.{}", section, key);
  }
  /// A key of strange characters must not break the one line.
  static std::string quoted_key(const std::string& key) {
    const std::string shown = quote(key);
    return shown.size() == key.size() + 2 ? shown.substr(1, key.size()) : shown;
  }
  Error error(const YAML::Node& node, const std::string& message) const {
    return fail(fmt::format("{}:{}: {}", source_, line_of(node), message));
  }

  std::string_view source_;
  std::vector<Field>& fields_;
};

}  // namespace

std::string unknown_key(std::string_view section, const std::vector<Field>& fields) {
  std::vector<std::string_view> known;
  for (const Field& field : fields) {
    const bool is_top = section.empty();
    const std::string_view name = is_top && !field.section.empty() ? field.section : field.key;
    const bool belongs = is_top || field.section == section;
    if (belongs && std::find(known.begin(), known.end(), name) == known.end()) {
      known.push_back(name);
    }
  }
  const std::string of = section.empty() ? "" : fmt::format(" of {}", section);
  return fmt::format("unknown key; known keys{}: {}", of, fmt::join(known, ", "));
}

std::string read_value(const YAML::Node& node, const Field& field) {
  std::string problem;
  if (auto* const* list = std::get_if<std::vector<double>*>(&field.value);
      list != nullptr && node.IsSequence()) {
    problem = read_list(node, **list);
  } else if (node.IsScalar()) {
    problem = parse_scalar(field, node.Scalar());
  } else {
    problem = fmt::format("expected {}, found {}",
                          list != nullptr ? "a list of numbers" : "one value", kind_of(node));
  }
  return problem.empty() ? violation_of(field) : problem;
}

bool is_set(const YAML::Node& root, const Field& field) {
  if (!root.IsMap()) {
    return false;
  }
  const YAML::Node map = field.section.empty() ? root : root[std::string(field.section)];
  return map && map.IsMap() && map[std::string(field.key)].IsDefined();
}

Expected<YAML::Node> parse_document(const std::string& text, std::string_view source) {
  try {
    const std::vector<YAML::Node> documents = YAML::LoadAll(text);
    if (documents.size() > 1) {
      return fail(fmt::format("{}:{}: expected one YAML document, found {}", source,
                              line_of(documents[1]), documents.size()));
    }
    return documents.empty() ? YAML::Node() : documents.front();
  } catch (const YAML::Exception& error) {
    return fail(fmt::format("{}:{}: not YAML: {}", source, error.mark.line + 1, error.msg));
  }
}

Status read_document(const YAML::Node& root, std::string_view source, std::vector<Field>& fields) {
  return MapReader(source, fields).read(root, "");
}

}  // namespace stemvo::config
