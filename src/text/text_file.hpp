// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "stemvo/error.hpp"

namespace stemvo {

/// What files hold at most, MB: calibrations, configurations and other settings; poses, times and
/// lists; any.
inline constexpr int kMaxSettings_MB = 1;
inline constexpr int kMaxRows_MB = 64;
inline constexpr int kMaxFile_MB = 1024;
/// Lines of a file of rows, and bytes of one.
inline constexpr std::size_t kMaxLines = 1000000;
inline constexpr std::size_t kMaxLineBytes = 65536;

/// What lies there, for messages: "a file", "a folder", "a pipe", "a device", "a socket", "nothing
/// of that name".
[[nodiscard]] std::string_view kind_of(const std::filesystem::path& path);

/// The whole file as it is. Error: missing, a folder, unreadable, larger. Throws std::system_error
/// where the process may open no more files.
[[nodiscard]] Expected<std::string> read_text_file(const std::filesystem::path& file,
                                                   int max_MB = kMaxFile_MB);
/// How many MB a file may hold, by its first bytes (64 kB, or all). Error: it is not read on.
using SizeLimit = std::function<Expected<int>(std::string_view start)>;
[[nodiscard]] Expected<std::string> read_text_file(const std::filesystem::path& file,
                                                   const SizeLimit& max_MB);
/// Where a file is written before it takes its name; what lies there is replaced.
[[nodiscard]] std::filesystem::path unfinished(const std::filesystem::path& file);
/// Replaces the file at once: whoever reads it finds the old or the new one, whole, also after a
/// kill or a full disk. Written beside as unfinished(), synced, renamed; a pipe or device in
/// place. Error: a folder, it cannot be created, or the disk took less than all of it.
[[nodiscard]] Status write_text_file(const std::filesystem::path& file, std::string_view text);
/// Proves that write_text_file can, without touching the file.
[[nodiscard]] Status check_can_write(const std::filesystem::path& file);

/// The file, if there is one, and what a killed write_text_file left of it. Error: it stays.
[[nodiscard]] Status remove_file(const std::filesystem::path& file);

/// A file of rows. Errors: those of read_text_file, too many lines, one that is too long.
[[nodiscard]] Expected<std::string> read_rows(const std::filesystem::path& file,
                                              int max_MB = kMaxRows_MB);
/// The same as lines without their ends.
[[nodiscard]] Expected<std::vector<std::string>> read_lines(const std::filesystem::path& file,
                                                            int max_MB = kMaxRows_MB);
/// Lines without their end (`\n` or `\r\n`); no empty line is added for the last newline.
[[nodiscard]] std::vector<std::string_view> split_lines(std::string_view text);
/// The next word between blanks and tabs, which the line loses; empty: there is none.
[[nodiscard]] std::string_view take_word(std::string_view& line);
/// All of them.
[[nodiscard]] std::vector<std::string_view> split_words(std::string_view line);

/// Of a text from elsewhere what a message may hold: one line of at most 300 bytes.
[[nodiscard]] std::string one_line(std::string_view text);
/// "file:line", line counted from 1, for messages.
[[nodiscard]] std::string at_line(const std::filesystem::path& file, std::size_t line);
/// The error with file and line in front; `index` counts lines from 0.
[[nodiscard]] Error fail_at(const std::filesystem::path& file,
                            std::size_t index,
                            const Error& error);

/// Nothing but decimal digits; nullopt: another text, or too large.
[[nodiscard]] std::optional<std::size_t> parse_index(std::string_view text);
/// Exactly `count` numbers of size up to 1e20, whatever the locale. The error says what was
/// expected and found, without file and line: "expected 12 numbers, found 11".
[[nodiscard]] Expected<std::vector<double>> parse_numbers(std::string_view line, std::size_t count);

}  // namespace stemvo
