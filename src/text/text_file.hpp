// SPDX-License-Identifier: MIT
#pragma once

#include <charconv>
#include <cstddef>
#include <filesystem>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "stemvo/error.hpp"

namespace stemvo {

/// The size limits, MB: of settings, whose YAML and JSON take long to parse, and of other files.
inline constexpr int kMaxSettings_MB = 1;
inline constexpr int kMaxFile_MB = 256;
inline constexpr double kNanosecond_s = 1e-9;

/// What cannot be seen is not there. A file: a regular one.
[[nodiscard]] bool is_there(const std::filesystem::path& path);
[[nodiscard]] bool is_file(const std::filesystem::path& path);
[[nodiscard]] bool is_folder(const std::filesystem::path& path);
/// "a file", "a folder", "nothing of that name", ..
[[nodiscard]] std::string_view kind_of(const std::filesystem::path& path);

/// The whole file as it is. Errors: missing, no regular file, unreadable, larger.
[[nodiscard]] Expected<std::string> read_text_file(const std::filesystem::path& file,
                                                   int max_MB = kMaxFile_MB);
/// Where a file is written before it takes its name; what lies there is replaced.
[[nodiscard]] std::filesystem::path unfinished(const std::filesystem::path& file);
/// Replaces the file at once: a reader finds the old or the new one, whole. It is written beside
/// and renamed. Errors: the place is no regular file's, or the file cannot be written whole.
[[nodiscard]] Status write_text_file(const std::filesystem::path& file, std::string_view text);

/// Proves that write_text_file can, without touching the file.
[[nodiscard]] Status check_can_write(const std::filesystem::path& file);

/// Removes the file, if there is one, and what a killed write_text_file left of it.
[[nodiscard]] Status remove_file(const std::filesystem::path& file);

[[nodiscard]] Expected<std::vector<std::string>> read_lines(const std::filesystem::path& file,
                                                            int max_MB = kMaxFile_MB);
/// Lines without their end (`\n` or `\r\n`); no empty line is added for the last newline.
[[nodiscard]] std::vector<std::string_view> split_lines(std::string_view text);
/// The next word between blanks and tabs, which the line loses; empty: there is none.
[[nodiscard]] std::string_view take_word(std::string_view& line);
[[nodiscard]] std::vector<std::string_view> split_words(std::string_view line);

/// Shortens a text from elsewhere to what a message may hold: one line of at most 300 bytes.
[[nodiscard]] std::string one_line(std::string_view text);
/// Adds a line, unless it is empty.
void add_line(std::vector<std::string>& lines, std::string line);
[[nodiscard]] Error fail_at(const std::filesystem::path& file,
                            std::size_t index,
                            const Error& error);
/// An error of it begins with the file and the line, counted from 0; or with its `owner`.
template <typename T>
Expected<T> at_line(const std::filesystem::path& file, std::size_t index, Expected<T> result) {
  return result ? std::move(result) : fail_at(file, index, result.error());
}
template <typename T>
Expected<T> named(const std::string& owner, Expected<T> result) {
  return result ? std::move(result) : fail(owner + ": " + result.error().message);
}

struct TimedRow {
  double time_s = 0.0;
  std::string rest;      ///< words between blanks
  std::size_t line = 0;  ///< counted from 0
};
/// The rows of such a file, at least one.
template <typename Row>
struct TimedRows {
  std::vector<Row> rows = {};
  std::string note = {};  ///< names the unit that was found by the steps, for people; else empty
};

/// Which times a file may hold: the unit of them is found by it.
struct UsualTimes {
  double min_step_s = 0.9e-3;
  double max_step_s = 3.0;
  /// First and last time of what the rows belong to, where it is known.
  std::optional<std::pair<double, double>> span_s = std::nullopt;
};

/// Rows of one of these numbers of words, between commas or blanks, `#` before comments; the times
/// rise, in this unit, or in ns where a comment says [ns]; seconds by default. Where the usual step
/// cannot be in the unit, it is found, and the note says so: the times are since 1970, or of the
/// span, or the steps are usual. `form` names a row. Errors, with file and line: unreadable, other
/// rows, no row, two units by whose steps the times may be.
[[nodiscard]] Expected<TimedRows<TimedRow>> read_timed_rows(
    const std::filesystem::path& file,
    std::initializer_list<std::size_t> counts,
    std::string_view form,
    const UsualTimes& usual = {},
    double unit_s = 1.0);

/// A decimal number that is all of the word, whatever the locale; '+' may stand before its digits.
/// Nullopt: another text, or too large.
template <typename Number>
[[nodiscard]] std::optional<Number> to_number(std::string_view word) {
  const bool has_plus = word.starts_with('+') && !word.starts_with("+-");
  Number number{};
  const char* const end = word.data() + word.size();
  const auto [stop, error] = std::from_chars(word.data() + (has_plus ? 1 : 0), end, number);
  return error == std::errc() && stop == end ? std::optional(number) : std::nullopt;
}
/// Exactly `count` numbers of size up to 1e20, whatever the locale. The error says what was
/// expected and found, without file and line: "expected 12 numbers, found 11".
[[nodiscard]] Expected<std::vector<double>> parse_numbers(std::string_view line, std::size_t count);

}  // namespace stemvo
