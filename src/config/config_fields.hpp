// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "stemvo/config.hpp"

namespace stemvo::config {

/// Which values a key may have. Bounds hold for every element of a list; infinite and NaN never
/// pass.
struct Rule {
  double min = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
  bool exclusive_min = false;
  bool odd = false;
  std::vector<std::string_view> choices;  ///< of a text; empty: any that is not empty
};

using FieldValue =
    std::variant<std::string*, int*, double*, bool*, std::uint64_t*, std::vector<double>*>;

/// One key: everything that reading, writing, checking and explaining it needs.
struct Field {
  std::string_view section;  ///< empty for the keys of the top level
  std::string_view key;
  FieldValue value;  ///< points into the Config given to fields_of()
  Rule rule;
  std::string_view help;

  [[nodiscard]] std::string name() const {
    return section.empty() ? std::string(key) : std::string(section) + "." + std::string(key);
  }
};

/// The table of all keys, in the order in which they are written.
[[nodiscard]] std::vector<Field> fields_of(Config& config);

/// Nothing, or what the rule expected and what the value is: "expected ..., found ...".
[[nodiscard]] std::string violation_of(const Field& field);

}  // namespace stemvo::config
