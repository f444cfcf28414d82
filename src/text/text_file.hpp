// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "stemvo/error.hpp"

namespace stemvo {

/// The whole file as it is. Error: missing, a folder, unreadable.
[[nodiscard]] Expected<std::string> read_text_file(const std::filesystem::path& file);
/// Replaces the file. Error: it cannot be created, or the disk took less than all of it.
[[nodiscard]] Status write_text_file(const std::filesystem::path& file, std::string_view text);

/// All lines of a file without their ends. Error: nothing there, a folder, unreadable.
[[nodiscard]] Expected<std::vector<std::string>> read_lines(const std::filesystem::path& file);
/// Lines without their end (`\n` or `\r\n`); no empty line is added for the last newline.
[[nodiscard]] std::vector<std::string_view> split_lines(std::string_view text);
/// Words between blanks and tabs.
[[nodiscard]] std::vector<std::string_view> split_words(std::string_view line);

/// "file:line", line counted from 1, for messages.
[[nodiscard]] std::string at_line(const std::filesystem::path& file, std::size_t line);
/// A finite number that is the whole word, whatever the locale. `where` starts the message.
[[nodiscard]] Expected<double> parse_finite(std::string_view word, const std::string& where);
/// Exactly `count` finite numbers, whatever the locale. The error says what was expected and found,
/// without file and line: "expected 12 numbers, found 11".
[[nodiscard]] Expected<std::vector<double>> parse_numbers(std::string_view line, std::size_t count);

}  // namespace stemvo
