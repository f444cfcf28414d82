// SPDX-License-Identifier: MIT
#include "text/text_table.hpp"

#include <algorithm>
#include <numeric>

#include <fmt/format.h>

namespace stemvo {
namespace {

/// Characters shown, not bytes: continuation bytes of UTF-8 take no room.
std::size_t width(const std::string& cell) {
  return static_cast<std::size_t>(std::ranges::count_if(
      cell, [](char c) { return (static_cast<unsigned char>(c) & 0xC0) != 0x80; }));
}

}  // namespace

std::string TextTable::str() const {
  std::vector<std::size_t> widths(alignment_.size(), 0);
  for (const auto& row : rows_) {
    for (std::size_t c = 0; c < row.size(); ++c) {
      widths[c] = std::max(widths[c], width(row[c]));
    }
  }
  const std::size_t total = std::accumulate(widths.begin(), widths.end(), 2 * (widths.size() - 1));
  std::string text;
  for (const auto& row : rows_) {
    std::string line = row.empty() ? std::string(total, '-') : "";
    for (std::size_t c = 0; c < row.size(); ++c) {
      const std::string padding(widths[c] - width(row[c]), ' ');
      line += c > 0 ? "  " : "";
      line += alignment_[c] == 'r' ? padding + row[c] : row[c] + padding;
    }
    line.erase(line.find_last_not_of(' ') + 1);
    text += line + '\n';
  }
  return text;
}

std::string number_or_dash(const std::optional<double>& value, int decimals) {
  return value ? fmt::format("{:.{}f}", *value, decimals) : "-";
}

std::string format_length(double length_m, int decimals) {
  return 1e-4 <= length_m && length_m < 1.0 ? fmt::format("{:.3g}", length_m)
                                            : fmt::format("{:.{}f}", length_m, decimals);
}

std::string length_range(const std::vector<double>& lengths_m) {
  return lengths_m.size() == 1 ? fmt::format("{:g} m", lengths_m.front())
                               : fmt::format("{:g}..{:g} m", lengths_m.front(), lengths_m.back());
}

}  // namespace stemvo
