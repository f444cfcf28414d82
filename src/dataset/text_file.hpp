// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "stemvo/error.hpp"

namespace stemvo::dataset {

/// All lines without their line ends (also CR LF). Error: the file cannot be opened or read.
[[nodiscard]] Expected<std::vector<std::string>> read_lines(const std::filesystem::path& file);

/// Words between spaces and tabs.
[[nodiscard]] std::vector<std::string_view> split_words(std::string_view line);

/// "file:line", line counted from 1, for messages.
[[nodiscard]] std::string at_line(const std::filesystem::path& file, std::size_t line);

/// A finite number that is the whole word, whatever the locale. `where` starts the message.
[[nodiscard]] Expected<double> parse_finite(std::string_view word, const std::string& where);

}  // namespace stemvo::dataset
