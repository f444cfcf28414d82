// SPDX-License-Identifier: MIT
#include "dataset/image_names.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <iterator>
#include <map>
#include <regex>
#include <set>
#include <tuple>

#include <fmt/format.h>

#include "try.hpp"

namespace stemvo::dataset {
namespace fs = std::filesystem;

namespace {

constexpr std::string_view kDigitCharacters = "0123456789";

bool is_digit(char c) { return kDigitCharacters.find(c) != std::string_view::npos; }

/// Where the digits from `begin` on end.
std::size_t end_of_digits(std::string_view name, std::size_t begin) {
  return std::min(name.find_first_not_of(kDigitCharacters, begin), name.size());
}

/// Each whole number becomes '0', the number of its digits without leading zeros, and these
/// digits: compared as text, it is compared by its value. With `has_decimals` digits behind "7."
/// are its decimals.
std::string sort_key(std::string_view name, bool has_decimals) {
  std::string key;
  for (std::size_t i = 0; i < name.size();) {
    if (!is_digit(name[i])) {
      key += name[i];
      ++i;
      continue;
    }
    const std::size_t begin = std::min(name.find_first_not_of('0', i), name.size());
    i = end_of_digits(name, begin);
    key += '0';
    key += static_cast<char>(i - begin);  // names have at most 255 characters
    key += name.substr(begin, i - begin);
    if (has_decimals) {
      key += '.';
      if (i + 1 < name.size() && name[i] == '.' && is_digit(name[i + 1])) {
        const std::size_t decimals = i + 1;
        i = end_of_digits(name, decimals);
        key += name.substr(decimals, i - decimals);
      }
      key += '\0';
    }
  }
  return key;
}

/// Seconds whose last zeros were left out ("5.25", "5.3"): of frames that are counted ("1.9",
/// "1.10") some end with one.
bool have_decimals(const std::vector<fs::path>& files) {
  static const std::regex kZero(".*[0-9]\\.[0-9]+0([^0-9].*)?");
  return std::ranges::none_of(
      files, [](const fs::path& file) { return std::regex_match(file.stem().string(), kZero); });
}

/// The numbers in a name, without leading zeros: of "left_007.png" those of "right_007.jpg".
std::string numbers_of(const fs::path& file) {
  const std::string stem = file.stem().string();
  std::string numbers;
  for (std::size_t i = stem.find_first_of(kDigitCharacters); i < stem.size();) {
    const std::size_t end = end_of_digits(stem, i);
    if (i < 2 || stem[i - 1] != '.' || !is_digit(stem[i - 2])) {  // else decimals
      i = std::min(stem.find_first_not_of('0', i), end - 1);      // a zero alone stays
    }
    numbers += stem.substr(i, end - i) + ' ';
    i = stem.find_first_of(kDigitCharacters, end);
  }
  return numbers;
}

/// A name around its last number: "cam1_", 7 and "" of "cam1_007".
struct NameParts {
  std::string before;
  double number = 0.0;  ///< a decimal one between _ or -: 0.033
  std::string behind;

  [[nodiscard]] std::string pattern() const { return before + "*" + behind; }
};

NameParts parts_of(const std::string& stem) {
  const auto start_of = [&](std::size_t end) {
    return end == 0 ? 0 : stem.find_last_not_of(kDigitCharacters, end - 1) + 1;
  };
  const std::size_t end = stem.find_last_of(kDigitCharacters) + 1;
  std::size_t start = start_of(end);
  if (start > 1 && stem[start - 1] == '.') {
    const std::size_t whole = start_of(start - 1);
    const bool is_apart = whole == 0 || stem[whole - 1] == '_' || stem[whole - 1] == '-';
    start = whole < start - 1 && is_apart ? whole : start;
  }
  const std::string number = stem.substr(start, end - start);
  return {stem.substr(0, start), std::strtod(number.c_str(), nullptr), stem.substr(end)};
}

/// The error that two images may be of one time, with a pattern that tells the first from the
/// other.
Error one_time(const fs::path& given,
               const fs::path& file,
               const fs::path& other,
               const std::string& pattern) {
  return fail(fmt::format(
      "{}: expected one image of each time, found {} beside {}; a quoted pattern tells which, as "
      "'{}'",
      given.string(), other.filename().string(), file.filename().string(),
      (file.parent_path() / (pattern + file.extension().string())).string()));
}

/// Images that may be a camera's own.
struct Group {
  fs::path first;
  std::string pattern;            ///< of their names, without the ending
  std::set<double> numbers = {};  ///< of the frames
};
using Groups = std::map<std::string, Group>;  // by what the camera may be called

/// Error: two groups are cameras: they have about as many frames, `least` or more, over much of the
/// same span.
Status check_groups(Groups groups, std::size_t least, const fs::path& given) {
  constexpr double kAlike = 0.8;
  std::erase_if(groups, [&](const auto& group) { return group.second.numbers.size() < least; });
  const auto are_cameras = [&](const auto& one, const auto& next) {
    const std::set<double>& a = one.second.numbers;
    const std::set<double>& b = next.second.numbers;
    const auto [fewer, more] = std::minmax({a.size(), b.size()});
    const double longer = std::max(*a.rbegin() - *a.begin(), *b.rbegin() - *b.begin());
    const double shared = std::min(*a.rbegin(), *b.rbegin()) - std::max(*a.begin(), *b.begin());
    return shared > kAlike * longer &&
           static_cast<double>(fewer) >= kAlike * static_cast<double>(more);
  };
  const auto found = std::ranges::adjacent_find(groups, are_cameras);
  if (found == groups.end()) {
    return {};
  }
  const Group& group = found->second;
  return one_time(given, group.first, std::next(found)->second.first, group.pattern);
}

/// Error: frames of several cameras, which are called behind the number ("7_cam0", "7_cam1") or
/// elsewhere ("left_7", "right_7"). More names than frames of each are hours or seconds.
Status check_cameras(const std::vector<fs::path>& files, const fs::path& given) {
  static const std::regex kBehind(
      "(.*[0-9][^0-9]*?)([_-]?[A-Za-z]{2,}[_-]?[0-9]|[_.-][A-Za-z][0-9]|[_-][0-4])");
  // Few digits behind a letter or before the number may be a camera's; others are of a time.
  static const std::regex kTimes(
      "((?:^|[^0-9])[A-Za-z](?:[0-9]{1,2}|[_-][0-9])(?![0-9])|^[0-9]{1,2}_$)|[0-9]+");
  Groups behind;
  Groups elsewhere;
  std::size_t num_behind = 0;
  for (const fs::path& file : files) {
    const std::string stem = file.stem().string();
    if (std::smatch match; std::regex_match(stem, match, kBehind)) {
      const std::string camera = match[2];
      Group& group = behind.try_emplace(camera, Group{file, "*" + camera}).first->second;
      group.numbers.insert(parts_of(match[1]).number);
      ++num_behind;
    }
    const NameParts parts = parts_of(stem);
    const std::string camera = std::regex_replace(parts.before, kTimes, "$1") + parts.behind;
    Group& group = elsewhere.try_emplace(camera, Group{file, parts.pattern()}).first->second;
    group.numbers.insert(parts.number);
  }
  if (5 * num_behind >= 4 * files.size()) {  // masks and a sixth camera may lie beside
    const bool is_number = behind.begin()->first.size() == 2;  // "_0" may be a part of a second
    STEMVO_TRY(check_groups(behind, is_number ? 5 : 3, given));
  }
  return check_groups(elsewhere, elsewhere.size(), given);
}

/// All larger rises are those of a clock's digits (hhmmss, with fractions or without) into the next
/// minute or hour.
bool are_of_clock(const std::vector<double>& rises, double step) {
  const auto is_of_clock = [&](double rise) {
    const double left = rise - step;  // 40 or 4040 of the last digits before the fractions
    return left == 0.0 || std::ranges::any_of(std::array{1.0, 1e3, 1e6, 1e9}, [&](double unit) {
             return left == 40.0 * unit || left == 4040.0 * unit;
           });
  };
  return std::ranges::max(rises) > step && std::ranges::all_of(rises, is_of_clock);
}

}  // namespace

bool comes_before(std::string_view a, std::string_view b, bool has_decimals) {
  return std::make_tuple(sort_key(a, has_decimals), a) <
         std::make_tuple(sort_key(b, has_decimals), b);
}

void sort_images(std::vector<fs::path>& files) {
  const bool has_decimals = have_decimals(files);
  std::ranges::sort(files, [&](const fs::path& a, const fs::path& b) {
    return comes_before(a.filename().string(), b.filename().string(), has_decimals);
  });
}

Status check_image_names(const std::vector<fs::path>& files, const fs::path& given) {
  std::map<std::string, fs::path> seen;
  for (const fs::path& file : files) {
    const std::string numbers = numbers_of(file);
    const auto [other, is_new] = seen.emplace(numbers, file);
    if (!is_new && !numbers.empty()) {  // two cameras, or one picture twice
      const fs::path& first = other->second;
      return one_time(given, first, file, parts_of(first.stem().string()).pattern());
    }
  }
  return check_cameras(files, given);
}

std::vector<double> count_frames(const std::vector<fs::path>& files,
                                 std::vector<std::string>& warnings) {
  std::vector<double> rises;
  bool is_count = files.size() > 1;
  for (std::size_t i = 1; i < files.size(); ++i) {
    const NameParts last = parts_of(files[i - 1].stem().string());
    const NameParts next = parts_of(files[i].stem().string());
    rises.push_back(next.number - last.number);
    is_count = is_count && next.before == last.before && next.behind == last.behind;
  }
  const double least = is_count ? std::ranges::min(rises) : 1.0;
  is_count = is_count && 2 * std::ranges::count(rises, least) >= std::ssize(rises) &&
             std::ranges::all_of(rises, [&](double r) { return std::fmod(r, least) == 0.0; }) &&
             !are_of_clock(rises, least);
  std::vector<double> steps = {0.0};
  for (const double rise : rises) {
    steps.push_back(steps.back() + (is_count ? rise / least : 1.0));
  }
  if (const double missing = steps.back() - static_cast<double>(rises.size()); missing > 0.0) {
    warnings.push_back(fmt::format("{}: missing up to it: {} numbers, which take their time",
                                   files.back().string(), missing));
  }
  return steps;
}

std::string warn_of_names(const std::vector<fs::path>& files) {
  const auto has_none = [](const fs::path& file) { return numbers_of(file).empty(); };
  const auto odd = std::ranges::find_if(files, has_none);
  return odd == files.end() || 2 * std::ranges::count_if(files, has_none) >= std::ssize(files)
             ? ""
             : fmt::format("{}: has no number, and is taken for a frame", odd->string());
}

}  // namespace stemvo::dataset
