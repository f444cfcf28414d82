// SPDX-License-Identifier: MIT
#include "dataset/text_file.hpp"

#include <charconv>
#include <cmath>
#include <fstream>

#include <fmt/format.h>

namespace stemvo::dataset {

Expected<std::vector<std::string>> read_lines(const std::filesystem::path& file) {
  std::error_code code;
  if (!std::filesystem::exists(file, code)) {
    return fail(fmt::format("{}: expected a file, found nothing", file.string()));
  }
  if (std::filesystem::is_directory(file, code)) {
    return fail(fmt::format("{}: expected a file, found a folder", file.string()));
  }
  std::ifstream stream(file);
  if (!stream) {
    return fail(fmt::format("{}: expected a readable file, cannot open it", file.string()));
  }
  std::vector<std::string> lines;
  for (std::string line; std::getline(stream, line);) {
    if (!line.empty() && line.back() == '\r') {
      line.pop_back();
    }
    lines.push_back(std::move(line));
  }
  if (stream.bad()) {
    return fail(fmt::format("{}: cannot read the file to its end", file.string()));
  }
  return lines;
}

std::vector<std::string_view> split_words(std::string_view line) {
  constexpr std::string_view kBlank = " \t";
  std::vector<std::string_view> words;
  for (std::size_t begin = line.find_first_not_of(kBlank); begin != std::string_view::npos;) {
    const std::size_t end = std::min(line.find_first_of(kBlank, begin), line.size());
    words.push_back(line.substr(begin, end - begin));
    begin = line.find_first_not_of(kBlank, end);
  }
  return words;
}

std::string at_line(const std::filesystem::path& file, std::size_t line) {
  return fmt::format("{}:{}", file.string(), line);
}

Expected<double> parse_finite(std::string_view word, const std::string& where) {
  const std::string_view digits = word.starts_with('+') ? word.substr(1) : word;
  double value = 0.0;
  const auto [end, code] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (code != std::errc() || end != digits.data() + digits.size() || !std::isfinite(value)) {
    return fail(fmt::format("{}: expected a finite number, found '{}'", where, word));
  }
  return value;
}

}  // namespace stemvo::dataset
