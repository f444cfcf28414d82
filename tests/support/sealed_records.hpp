// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <string_view>

#include <fmt/format.h>

#include "io/sha256.hpp"
#include "text/text_file.hpp"

namespace stemvo::test {

/// The lines of a records.jsonl, whatever was done to them, each under a seal that fits.
inline std::string seal_again(std::string_view text) {
  constexpr std::string_view kBefore = "\"of\":";
  std::string sealed;
  std::string first;
  for (std::string_view line : split_lines(text)) {
    const std::size_t at = line.find(kBefore);
    if (at != line.npos) {
      line = line.substr(at + kBefore.size());
      line.remove_suffix(line.empty() ? 0 : 1);
    }
    sealed += fmt::format("{{\"sha256\":\"{}\",\"of\":{}}}\n",
                          internal::sha256_hex(first + std::string(line)), line);
    first = first.empty() ? std::string(line) : first;
  }
  return sealed;
}

}  // namespace stemvo::test
