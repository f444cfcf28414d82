// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <string_view>

#include "config/config_fields.hpp"

namespace stemvo::config {

/// 'text' on one line, cut when long, for messages.
[[nodiscard]] std::string quote(std::string_view text);

/// Reads one scalar into a field that is no list. Decimal numbers only ("010" is ten). Returns
/// nothing, or "expected ..., found ...".
[[nodiscard]] std::string parse_scalar(const Field& field, std::string_view text);

/// Reads one element of a list of numbers.
[[nodiscard]] std::string parse_number(std::string_view text, double& value);

/// YAML of the value, exact: numbers read back to the same bits.
[[nodiscard]] std::string format_value(const Field& field);

}  // namespace stemvo::config
