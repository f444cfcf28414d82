// SPDX-License-Identifier: MIT
#include "text/text_file.hpp"

#include <cerrno>
#include <charconv>
#include <cmath>
#include <fstream>
#include <iterator>
#include <optional>
#include <system_error>

#include <fmt/core.h>

namespace stemvo {

namespace {

std::string last_system_error() { return std::generic_category().message(errno); }

/// Nullopt: not a finite number, or not all of the word.
std::optional<double> to_finite(std::string_view word) {
  const std::string_view digits = word.starts_with('+') ? word.substr(1) : word;
  double number = 0.0;
  const auto [end, error] = std::from_chars(digits.begin(), digits.end(), number);
  const bool is_good = error == std::errc() && end == digits.end() && std::isfinite(number);
  return is_good ? std::optional(number) : std::nullopt;
}

/// Long words (a binary file) would drown the message.
std::string_view shown(std::string_view word) { return word.substr(0, 40); }

}  // namespace

Expected<std::string> read_text_file(const std::filesystem::path& file) {
  std::error_code ignored;
  if (std::filesystem::is_directory(file, ignored)) {
    return fail(fmt::format("{}: expected a file, found a folder", file.string()));
  }
  errno = 0;
  std::ifstream stream(file, std::ios::binary);
  if (!stream) {
    return fail(fmt::format("{}: cannot read: {}", file.string(), last_system_error()));
  }
  std::string text{std::istreambuf_iterator<char>(stream), {}};
  if (stream.bad()) {
    return fail(fmt::format("{}: cannot read: {}", file.string(), last_system_error()));
  }
  return text;
}

Status write_text_file(const std::filesystem::path& file, std::string_view text) {
  errno = 0;
  std::ofstream stream(file, std::ios::binary | std::ios::trunc);
  if (!stream) {
    return fail(fmt::format("{}: cannot write: {}", file.string(), last_system_error()));
  }
  stream.write(text.data(), static_cast<std::streamsize>(text.size()));
  stream.close();  // a full disk shows here
  if (!stream) {
    return fail(fmt::format("{}: cannot write: {}", file.string(), last_system_error()));
  }
  return {};
}

Expected<std::vector<std::string>> read_lines(const std::filesystem::path& file) {
  std::error_code ignored;
  if (!std::filesystem::exists(file, ignored)) {
    return fail(fmt::format("{}: expected a file, found nothing", file.string()));
  }
  const Expected<std::string> text = read_text_file(file);
  if (!text) {
    return text.error();
  }
  const std::vector<std::string_view> lines = split_lines(*text);
  return std::vector<std::string>(lines.begin(), lines.end());
}

std::vector<std::string_view> split_lines(std::string_view text) {
  std::vector<std::string_view> lines;
  while (!text.empty()) {
    const std::size_t end = text.find('\n');
    std::string_view line = text.substr(0, end);
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    if (line.ends_with('\r')) {
      line.remove_suffix(1);
    }
    lines.push_back(line);
  }
  return lines;
}

std::vector<std::string_view> split_words(std::string_view line) {
  constexpr std::string_view kBlanks = " \t";
  std::vector<std::string_view> words;
  std::size_t begin = line.find_first_not_of(kBlanks);
  while (begin != std::string_view::npos) {
    const std::size_t end = line.find_first_of(kBlanks, begin);
    words.push_back(line.substr(begin, end - begin));
    begin = line.find_first_not_of(kBlanks, end);
  }
  return words;
}

std::string at_line(const std::filesystem::path& file, std::size_t line) {
  return fmt::format("{}:{}", file.string(), line);
}

Expected<double> parse_finite(std::string_view word, const std::string& where) {
  if (const std::optional<double> number = to_finite(word)) {
    return *number;
  }
  return fail(fmt::format("{}: expected a finite number, found '{}'", where, shown(word)));
}

Expected<std::vector<double>> parse_numbers(std::string_view line, std::size_t count) {
  std::vector<double> numbers;
  const std::vector<std::string_view> words = split_words(line);
  for (const std::string_view word : words) {
    const std::optional<double> number = to_finite(word);
    if (!number) {
      return fail(fmt::format("expected a finite number, found '{}'", shown(word)));
    }
    numbers.push_back(*number);
  }
  if (numbers.size() != count) {
    return fail(fmt::format("expected {} numbers, found {}", count, numbers.size()));
  }
  return numbers;
}

}  // namespace stemvo
