// SPDX-License-Identifier: MIT
#include "text/text_file.hpp"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <system_error>

#include <fmt/core.h>

#include "geometry/median.hpp"
#include "try.hpp"

namespace stemvo {
namespace {

namespace fs = std::filesystem;

Error cannot(std::string_view verb, const fs::path& file, int reason) {
  return fail(fmt::format("{}: cannot {}: {}{}", file.string(), verb,
                          std::generic_category().message(reason),
                          reason == ENOENT ? "; check the path" : ""));
}

/// Error: the place is taken by a folder, a device or another thing that a file cannot replace.
Status check_place(const fs::path& file) {
  if (is_there(file) && !is_file(file)) {
    return fail(
        fmt::format("{}: expected a file to write, found {}", file.string(), kind_of(file)));
  }
  return {};
}

}  // namespace

bool is_there(const fs::path& path) {
  std::error_code ignored;
  return fs::exists(path, ignored);
}

bool is_file(const fs::path& path) {
  std::error_code ignored;
  return fs::is_regular_file(path, ignored);
}

bool is_folder(const fs::path& path) {
  std::error_code ignored;
  return fs::is_directory(path, ignored);
}

std::string_view kind_of(const fs::path& path) {
  return is_file(path)     ? "a file"
         : is_folder(path) ? "a folder"
         : is_there(path)  ? "neither a file nor a folder"
                           : "nothing of that name";
}

fs::path unfinished(const fs::path& file) { return fs::path(file.string() + ".unfinished"); }

Expected<std::string> read_text_file(const fs::path& file, int max_MB) {
  constexpr std::uintmax_t kBytesOfMB = 1000000;
  std::error_code code;
  if (is_there(file) && !is_file(file)) {
    return fail(fmt::format("{}: expected a file, found {}", file.string(), kind_of(file)));
  }
  const std::uintmax_t size = fs::file_size(file, code);
  if (code) {
    return cannot("read", file, code.value());
  }
  if (size > static_cast<std::uintmax_t>(max_MB) * kBytesOfMB) {
    return fail(fmt::format("{}: expected at most {} MB, found {} MB", file.string(), max_MB,
                            static_cast<double>(size) / kBytesOfMB));
  }
  errno = 0;
  std::string text(size, '\0');
  std::ifstream stream(file, std::ios::binary);
  stream.read(text.data(), static_cast<std::streamsize>(size));
  constexpr std::string_view kMark = "\xEF\xBB\xBF";  // Windows' editors begin UTF-8 with it
  text.erase(0, text.starts_with(kMark) ? kMark.size() : 0);
  return stream ? Expected<std::string>(std::move(text)) : cannot("read", file, errno);
}

Status write_text_file(const fs::path& file, std::string_view text) {
  STEMVO_TRY(check_place(file));
  errno = 0;
  std::ofstream stream(unfinished(file), std::ios::binary);
  stream << text;
  stream.close();
  std::error_code code(stream ? 0 : std::max(errno, 1), std::generic_category());
  if (!code) {
    fs::rename(unfinished(file), file, code);
  }
  std::error_code ignored;
  fs::remove(unfinished(file), ignored);
  return code ? Status(cannot("write", file, code.value())) : Status();
}

Status check_can_write(const fs::path& file) {
  STEMVO_TRY(check_place(file));
  errno = 0;
  const bool is_open = std::ofstream(unfinished(file), std::ios::binary).is_open();
  const int reason = errno;
  std::error_code ignored;
  fs::remove(unfinished(file), ignored);
  return is_open ? Status() : Status(cannot("write", file, reason));
}

Status remove_file(const fs::path& file) {
  std::error_code code;
  fs::remove(unfinished(file), code);
  fs::remove(file, code);
  return code ? Status(
                    fail(fmt::format("{}: cannot be removed ({})", file.string(), code.message())))
              : Status();
}

Expected<std::vector<std::string>> read_lines(const fs::path& file, int max_MB) {
  return read_text_file(file, max_MB).map([](const std::string& text) {
    const std::vector<std::string_view> lines = split_lines(text);
    return std::vector<std::string>(lines.begin(), lines.end());
  });
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

std::string_view take_word(std::string_view& line) {
  const auto is_blank = [](char c) { return c == ' ' || c == '\t'; };
  const auto* const begin = std::find_if_not(line.begin(), line.end(), is_blank);
  const std::string_view word(begin, std::find_if(begin, line.end(), is_blank));
  line = {word.end(), line.end()};
  return word;
}

std::vector<std::string_view> split_words(std::string_view line) {
  std::vector<std::string_view> words;
  for (auto word = take_word(line); !word.empty(); word = take_word(line)) {
    words.push_back(word);
  }
  return words;
}

std::string one_line(std::string_view text) {
  constexpr std::size_t kMaxBytes = 300;
  std::string line(text.substr(0, kMaxBytes));
  std::ranges::replace_if(line, [](unsigned char c) { return c < 0x20; }, ' ');
  return text.size() > kMaxBytes ? line + ".." : line;
}

void add_line(std::vector<std::string>& lines, std::string line) {
  if (!line.empty()) {
    lines.push_back(std::move(line));
  }
}

Error fail_at(const fs::path& file, std::size_t index, const Error& error) {
  return fail(fmt::format("{}:{}: {}", file.string(), index + 1, error.message));
}

namespace {

struct Unit {
  double size_s;
  const char* name;
};
constexpr Unit kUnits[] = {{1.0, "seconds"},
                           {1e-3, "milliseconds"},
                           {1e-6, "microseconds"},
                           {kNanosecond_s, "nanoseconds"}};

double usual_step(const std::vector<TimedRow>& rows) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < rows.size(); ++i) {
    steps.push_back(rows[i].time_s - rows[i - 1].time_s);
  }
  return median(std::move(steps));
}

/// Lengths of time in one unit differ by less: half the way to the next unit.
constexpr double kMaxRatio = 30.0;

/// Times from `first` to `last` and those of the span lie over each other and are of one length.
bool is_of_span(double first, double last, const std::pair<double, double>& span_s) {
  const double length = last - first;
  const double expected = span_s.second - span_s.first;
  return first <= span_s.second && last >= span_s.first && length <= kMaxRatio * expected &&
         expected <= kMaxRatio * length;
}

/// The unit of times whose rows are not scaled yet. Error: it may be one of two.
Expected<Unit> find_unit(const std::vector<TimedRow>& rows, const UsualTimes& usual) {
  const double step = usual_step(rows);
  const double first = rows.front().time_s;
  const double last = rows.back().time_s;
  const auto is_short = [&](const Unit& unit) { return step * unit.size_s <= usual.max_step_s; };
  // Where rows would lie in a moment of the drive, they are of a larger unit, and miss it.
  const auto covers_frames = [&](const Unit& unit) {
    return !usual.span_s ||
           usual.span_s->second - usual.span_s->first <= kMaxRatio * (last - first) * unit.size_s;
  };
  const auto is_since_1970 = [&](const Unit& unit) {
    return first * unit.size_s >= 1e9 && last * unit.size_s <= 4e9;
  };
  for (const Unit& unit : kUnits) {
    if (is_short(unit) && is_since_1970(unit)) {
      return unit;
    }
  }
  if (is_short(kUnits[0])) {
    return kUnits[0];
  }
  const bool may_be_rare = step <= 600.0 && is_since_1970(kUnits[0]);  // photos, 10 minutes apart
  std::vector<Unit> usual_units;
  for (const Unit& unit : kUnits) {
    const bool is_long = unit.size_s == 1.0 || step * unit.size_s >= usual.min_step_s;
    if (is_long && usual.span_s &&
        is_of_span(first * unit.size_s, last * unit.size_s, *usual.span_s)) {
      return unit;
    }
    const bool is_usual = is_short(unit) || (unit.size_s == 1.0 && may_be_rare);
    if (is_long && is_usual && covers_frames(unit)) {
      usual_units.push_back(unit);
    }
  }
  if (usual_units.size() > 1) {
    return fail(fmt::format("expected times in seconds, found steps of {}, {} or {}", step,
                            usual_units[0].name, usual_units[1].name));
  }
  if (usual_units.empty()) {
    return usual.span_s ? kUnits[0] : std::end(kUnits)[-1];
  }
  return usual_units[0];
}

}  // namespace

Expected<TimedRows<TimedRow>> read_timed_rows(const fs::path& file,
                                              std::initializer_list<std::size_t> counts,
                                              std::string_view form,
                                              const UsualTimes& usual,
                                              double unit_s) {
  STEMVO_TRY_GET(const auto lines, read_lines(file));
  TimedRows<TimedRow> result;
  std::vector<TimedRow>& rows = result.rows;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const std::size_t comment = std::min(lines[i].find('#'), lines[i].size());
    if (lines[i].find("[ns]", comment) != std::string::npos) {
      unit_s = kNanosecond_s;  // EuRoC's
    }
    std::string line = lines[i].substr(0, comment);
    std::ranges::replace(line, ',', ' ');
    const std::size_t count = split_words(line).size();
    if (count == 0) {
      continue;
    }
    if (std::ranges::find(counts, count) == counts.end()) {
      return fail_at(file, i, fail(fmt::format("expected {}, found {} words", form, count)));
    }
    std::string_view rest = line;
    STEMVO_TRY_GET(const auto time, at_line(file, i, parse_numbers(take_word(rest), 1)));
    if (!rows.empty() && !(time.front() > rows.back().time_s)) {
      return fail_at(file, i,
                     fail(fmt::format("expected a time after {} s, found {} s",
                                      unit_s * rows.back().time_s, unit_s * time.front())));
    }
    rows.push_back({time.front(), std::string(rest), i});
  }
  if (rows.empty()) {
    return fail(fmt::format("{}: expected rows of {}, found none", file.string(), form));
  }
  const bool is_said =
      unit_s != 1.0 && (rows.size() == 1 || usual_step(rows) * unit_s >= usual.min_step_s);
  if (!is_said) {
    STEMVO_TRY_GET(const Unit unit, named(file.string(), find_unit(rows, usual)));
    if (unit.size_s != unit_s) {
      result.note =
          fmt::format("{}: times are taken for {}, by their steps", file.string(), unit.name);
    }
    unit_s = unit.size_s;
  }
  for (TimedRow& row : rows) {
    row.time_s *= unit_s;
  }
  return result;
}

Expected<std::vector<double>> parse_numbers(std::string_view line, std::size_t count) {
  constexpr double kLargest = 1e20;  // squares and sums stay finite
  std::vector<double> numbers;
  for (const std::string_view word : split_words(line)) {
    const auto number = to_number<double>(word);
    if (!number || !(std::abs(*number) <= kLargest)) {
      return fail(fmt::format("expected a finite number, found '{}'",
                              word.substr(0, 40)));  // a binary file has long words
    }
    numbers.push_back(*number);
  }
  if (numbers.size() != count) {
    return fail(fmt::format("expected {} number{}, found {}", count, count == 1 ? "" : "s",
                            numbers.size()));
  }
  return numbers;
}

}  // namespace stemvo
