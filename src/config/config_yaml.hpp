// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <yaml-cpp/yaml.h>

#include "options/option_fields.hpp"
#include "stemvo/error.hpp"

namespace stemvo::config {

using namespace options;  // NOLINT: the fields are read and written here

/// The one document of a YAML text. Errors "<source>:<line>: ...": not YAML, several documents.
[[nodiscard]] Expected<YAML::Node> parse_document(const std::string& text, std::string_view source);

/// Reads a document into the fields it names, and marks them. Errors "<source>:<line>: <key>: ...":
/// unknown or duplicated key, wrong type, value the rule refuses.
[[nodiscard]] Status read_document(const YAML::Node& root,
                                   std::string_view source,
                                   std::vector<Field>& fields);

/// Reads what --set gives: a list as it is written in a file; anything else as it stands, so that a
/// path may hold any character. Decimal numbers only ("010" is ten). Nothing, or "expected ...,
/// found ...".
[[nodiscard]] std::string read_assigned(const std::string& text, const Field& field);

/// "unknown key; known keys of stem: model, filter, ..."
[[nodiscard]] std::string unknown_key(std::string_view section,
                                      std::string_view key,
                                      const std::vector<Field>& fields);

/// YAML of the value, exact: numbers read back to the same bits.
[[nodiscard]] std::string format_value(const Field& field);

}  // namespace stemvo::config
