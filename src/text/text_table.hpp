// SPDX-License-Identifier: MIT
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace stemvo {

/// Rows of cells, columns two blanks apart, nothing behind the last cell of a row.
class TextTable {
 public:
  /// One character per column: 'l' left, 'r' right.
  explicit TextTable(std::string alignment) : alignment_(std::move(alignment)) {}

  /// At most as many cells as columns.
  void add(std::vector<std::string> cells) { rows_.push_back(std::move(cells)); }
  void rule() { rows_.emplace_back(); }
  [[nodiscard]] std::string str() const;

 private:
  std::string alignment_;
  std::vector<std::vector<std::string>> rows_;  ///< an empty row is a rule
};

[[nodiscard]] std::string number_or_dash(const std::optional<double>& value, int decimals);

/// Metres: three significant digits below 1 (and above 0.1 mm), else this many decimals.
[[nodiscard]] std::string format_length(double length_m, int decimals);

/// "100..800 m": first and last of the lengths.
[[nodiscard]] std::string length_range(const std::vector<double>& lengths_m);

}  // namespace stemvo
