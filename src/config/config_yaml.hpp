// SPDX-License-Identifier: MIT
#pragma once

#include <concepts>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include "options/visit.hpp"
#include "stemvo/error.hpp"

namespace stemvo::config {

/// The one document of a YAML text. Errors "<source>:<line>: ...": not YAML, several documents.
[[nodiscard]] Expected<YAML::Node> parse_document(const std::string& text, std::string_view source);
/// The same of a file. Error: it cannot be read, too.
[[nodiscard]] Expected<YAML::Node> read_document(const std::filesystem::path& file);

/// Read a value, numbers in decimal ("010" is ten). Nothing, or "expected ..., found ...". A list
/// may also stand in a text, as --set gives it.
[[nodiscard]] std::string parse(const YAML::Node& node, bool& value);
template <options::Number N>
[[nodiscard]] std::string parse(const YAML::Node& node, N& value);
[[nodiscard]] std::string parse(const YAML::Node& node, std::string& value);
[[nodiscard]] std::string parse(const YAML::Node& node, std::vector<double>& value);
template <options::Enumeration Enum>
[[nodiscard]] std::string parse(const YAML::Node& node, Enum& value) {
  std::string name;
  const std::string problem = parse(node, name);
  const auto& names = options::kNames<Enum>;
  value = options::from_string<Enum>(name);
  return problem.empty() ? violation_of(name, options::Rule::one_of({names.begin(), names.end()}))
                         : problem;
}

/// YAML of a value, exact: numbers read back to the same bits.
template <std::integral Integer>  // or bool
[[nodiscard]] std::string format(Integer value) {
  return fmt::format("{}", value);
}
[[nodiscard]] std::string format(double value);
[[nodiscard]] std::string format(const std::string& value);
[[nodiscard]] std::string format(const std::vector<double>& value);
template <options::Enumeration Enum>
[[nodiscard]] std::string format(Enum value) {
  return std::string(options::to_string(value));
}

/// A key that a document may have. Its value must outlive it.
struct Key {
  template <typename Value>
  Key(std::string_view section_name,
      std::string_view key_name,
      Value& value,
      const options::Rule& rule = {})
      : section(section_name), key(key_name), read([&value, rule](const YAML::Node& node) {
          Value found{};
          std::string problem = parse(node, found);
          problem = problem.empty() ? options::violation_of(found, rule) : problem;
          if (problem.empty()) {
            value = std::move(found);
          }
          return problem;
        }) {}

  std::string_view section;  ///< empty for the keys of the top level
  std::string_view key;
  std::function<std::string(const YAML::Node&)> read;
  bool is_given = false;  ///< a document that was read names it

  [[nodiscard]] std::string name() const { return options::full_name(section, key); }
};

/// Reads a document (section empty), or one of its sections, into the keys it names, and marks
/// them. Errors "<source>:<line>: <key>: ...": unknown or duplicated key, wrong type, value the
/// rule refuses.
[[nodiscard]] Status read_map(const YAML::Node& map,
                              std::string_view section,
                              std::string_view source,
                              std::vector<Key>& keys);

/// Reads one value into the key of this name. Nothing, or the problem: unknown key, value refused.
[[nodiscard]] std::string read_key(std::string_view section,
                                   const std::string& key,
                                   const YAML::Node& value,
                                   std::vector<Key>& keys);

}  // namespace stemvo::config
