// SPDX-License-Identifier: MIT
#include "dataset/image_names.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstdlib>
#include <map>
#include <regex>
#include <set>
#include <tuple>
#include <utility>

#include <fmt/format.h>

#include "try.hpp"

namespace stemvo::dataset {
namespace fs = std::filesystem;

namespace {

constexpr std::string_view kDigitCharacters = "0123456789";

bool is_digit(char c) { return kDigitCharacters.find(c) != std::string_view::npos; }

/// Each whole number becomes '0', the number of its digits without leading zeros, and these
/// digits: compared as text, it is compared by its value. With `has_decimals` digits behind "7."
/// are its decimals.
std::string sort_key(std::string_view name, bool has_decimals) {
  std::string key;
  const auto take_digits = [&name] {
    const std::size_t length = std::min(name.find_first_not_of(kDigitCharacters), name.size());
    const std::string_view digits = name.substr(0, length);
    name.remove_prefix(length);
    return digits;
  };
  while (!name.empty()) {
    if (!is_digit(name.front())) {
      key += name.front();
      name.remove_prefix(1);
      continue;
    }
    std::string_view number = take_digits();
    number.remove_prefix(std::min(number.find_first_not_of('0'), number.size()));
    key += '0';
    key += static_cast<char>(number.size());  // names have at most 255 characters
    key += number;
    if (has_decimals) {
      key += '.';
      if (name.size() > 1 && name.front() == '.' && is_digit(name[1])) {
        name.remove_prefix(1);
        key += take_digits();
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
    const std::size_t end = std::min(stem.find_first_not_of(kDigitCharacters, i), stem.size());
    if (i < 2 || stem[i - 1] != '.' || !is_digit(stem[i - 2])) {  // else decimals
      i = std::min(stem.find_first_not_of('0', i), end - 1);      // a zero alone stays
    }
    numbers += stem.substr(i, end - i) + ' ';
    i = stem.find_first_of(kDigitCharacters, end);
  }
  return numbers;
}

/// A name around its last number: "cam1_", "7" and "" of "cam1_007.png".
struct NameParts {
  std::string before;
  std::string number;  ///< without leading zeros; a decimal one between _ or -: "0.033"
  std::string behind;
};

NameParts parts_of(const fs::path& file) {
  const std::string stem = file.stem().string();
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
  return {stem.substr(0, start),
          number.substr(std::min(number.find_first_not_of('0'), number.size())), stem.substr(end)};
}

/// The error that two images may be of one time, with a pattern that tells the first from the
/// other.
Error one_time(const fs::path& given, const fs::path& file, const fs::path& other) {
  const NameParts parts = parts_of(file);
  const NameParts others = parts_of(other);
  const bool is_named_alike = parts.before == others.before && parts.behind == others.behind;
  const std::string pattern = is_named_alike
                                  ? "*" + other.extension().string()
                                  : parts.before + "*" + parts.behind + file.extension().string();
  return fail(fmt::format(
      "{}: expected one image of each number, found {} and {}; a quoted pattern tells which, "
      "as '{}'",
      given.string(), file.filename().string(), other.filename().string(),
      (file.parent_path() / pattern).string()));
}

/// The least and the largest.
std::pair<double, double> span_of(const std::set<std::string>& numbers) {
  std::set<double> values;
  for (const std::string& number : numbers) {
    values.insert(std::strtod(number.c_str(), nullptr));
  }
  return {*values.begin(), *values.rbegin()};
}

/// Whole minutes: the numbers are seconds, which go on from one beginning to the next ("12-30-59",
/// "12-31-00") in their usual step. `before`: one of the beginnings.
bool are_seconds(const std::string& before, const std::set<std::string>& numbers) {
  static const std::regex kMinute("(.*[^0-9])?([01][0-9]|2[0-3])[^0-9]?[0-5][0-9][^0-9]");
  constexpr double kMinute_s = 60.0;
  const auto [first, last] = span_of(numbers);
  const double step_s = (last - first) / static_cast<double>(numbers.size() - 1);
  return last < kMinute_s && kMinute_s + first - last < 1.5 * step_s &&
         std::regex_match(before, kMinute);
}

constexpr std::size_t kMostCameras = 6;

/// Numbers alone ("_0", "_1") are cameras' where a few follow each other, many times: else they may
/// be seconds.
bool may_be_cameras(const std::set<std::string>& names, std::size_t num_moments) {
  constexpr std::size_t kMany = 5;
  std::set<double> numbers;
  for (const std::string& name : names) {
    if (std::ranges::any_of(name, [](unsigned char c) { return std::isalpha(c) != 0; })) {
      return names.size() > 1;
    }
    numbers.insert(std::strtod(name.c_str() + std::min<std::size_t>(name.size(), 1), nullptr));
  }
  return names.size() > 1 && names.size() <= kMostCameras && num_moments >= kMany &&
         *numbers.rbegin() - *numbers.begin() + 1.0 == static_cast<double>(names.size());
}

/// Error: frames of several cameras in pairs ("7_cam0", "7_cam1") or in turns ("7_cam0", "8_cam1"),
/// or an image beside its copy ("7 (1).png").
Status check_names(const std::vector<fs::path>& files, const fs::path& given) {
  static const std::regex kCopy("(.+?)( \\([0-9]+\\)|[ _-]+[Cc]opy.*)");
  static const std::regex kCamera(
      "(.*[0-9][^0-9]*?)([_-]?[A-Za-z]{2,}[_-]?[0-9]|[_.-][A-Za-z][0-9]|[_-][0-9]{1,2})");
  std::set<std::string> stems;
  std::set<std::string> moments;
  std::set<std::string> cameras;
  std::string last;
  std::size_t num_turns = 0;
  for (const fs::path& file : files) {
    const std::string stem = file.stem().string();
    std::smatch part;
    const bool has_camera = std::regex_match(stem, part, kCamera);
    moments.insert(has_camera ? part[1].str() : stem);
    const std::string camera = has_camera ? part[2].str() : "";
    num_turns += std::exchange(last, camera) == camera ? 0U : 1U;
    cameras.insert(camera);
    stems.insert(stem);
  }
  const auto fail_of = [&](const fs::path& file, const std::string& frames) {
    return fail(fmt::format(
        "{}: expected frames of one camera alone, found {}; a quoted pattern tells which, as '{}'",
        given.string(), file.filename().string(),
        (file.parent_path() / ("*" + frames + file.extension().string())).string()));
  };
  constexpr double kMost = 0.9;  // some frames may be missing
  const auto num_pairs = static_cast<double>(moments.size() * cameras.size());
  const auto num_files = static_cast<double>(files.size());
  const bool take_turns = cameras.size() <= kMostCameras && files.size() >= 3 * cameras.size() &&
                          moments.size() == files.size() &&
                          static_cast<double>(num_turns) > kMost * num_files;
  if (may_be_cameras(cameras, moments.size()) && moments.size() > cameras.size() &&
      (num_files > kMost * num_pairs || take_turns)) {
    return fail_of(files[1], *cameras.begin());
  }
  for (const fs::path& file : files) {
    const std::string stem = file.stem().string();
    std::smatch part;
    if (std::regex_match(stem, part, kCopy) && stems.contains(part[1])) {
      return fail_of(file, "[0-9]");
    }
  }
  return {};
}

/// Two beginnings of names may be of two cameras: their letters differ ("left_", "right_"), or one
/// digit behind letters ("cam0_", "cam1_"), and not the digits of a date or an hour.
bool tell_cameras(const NameParts& a, const NameParts& b) {
  static const std::regex kNumbered("[^0-9]*[A-Za-z][^0-9]*[0-9][^0-9]*");
  const auto letters_of = [](const NameParts& parts) {
    std::string name = parts.before + parts.behind;
    std::erase_if(name, [](unsigned char c) { return std::isdigit(c) != 0; });
    return name;
  };
  return letters_of(a) != letters_of(b) ||
         (std::regex_match(a.before, kNumbered) && std::regex_match(b.before, kNumbered));
}

/// About as many of each, over much of the same span.
bool are_of_one_time(const std::set<std::string>& a, const std::set<std::string>& b) {
  constexpr std::size_t kMin = 3;
  constexpr double kAlike = 0.8;
  const auto [first_a, last_a] = span_of(a);
  const auto [first_b, last_b] = span_of(b);
  const auto [fewer, more] = std::minmax({a.size(), b.size()});
  return fewer >= kMin && static_cast<double>(fewer) >= kAlike * static_cast<double>(more) &&
         std::min(last_a, last_b) - std::max(first_a, first_b) >
             kAlike * std::max(last_a - first_a, last_b - first_b);
}

/// Error: two images of one number, which are two cameras or one picture twice; or names with the
/// same last numbers behind several beginnings (cam1_, cam2_), which are as many cameras. Where
/// there are more beginnings than numbers, they are hours or seconds; so are whole minutes.
Status check_numbers(const std::vector<fs::path>& files, const fs::path& given) {
  struct Group {
    std::set<std::string> numbers;
    fs::path first;
  };
  std::map<std::string, fs::path> seen;
  std::map<std::pair<std::string, std::string>, Group> groups;
  for (const fs::path& file : files) {
    const std::string numbers = numbers_of(file);
    const auto [other, is_new] = seen.emplace(numbers, file);
    if (!is_new && !numbers.empty()) {
      return one_time(given, other->second, file);
    }
    const NameParts parts = parts_of(file);
    Group& group = groups[{parts.before, parts.behind}];
    group.first = group.numbers.empty() ? file : group.first;
    group.numbers.insert(parts.number);
  }
  std::map<std::set<std::string>, std::vector<fs::path>> cameras;
  for (const auto& [name, group] : groups) {
    cameras[group.numbers].push_back(group.first);
  }
  for (const auto& [numbers, firsts] : cameras) {
    if (firsts.size() > 1 && numbers.size() >= firsts.size() && numbers.size() > 1 &&
        !are_seconds(parts_of(firsts[0]).before, numbers)) {
      return one_time(given, firsts[0], firsts[1]);
    }
  }
  // Cameras whose numbers are their own, but of one time.
  for (auto b = groups.begin(), a = b; b != groups.end(); a = b++) {
    if (a != b && tell_cameras(parts_of(a->second.first), parts_of(b->second.first)) &&
        are_of_one_time(a->second.numbers, b->second.numbers)) {
      return one_time(given, a->second.first, b->second.first);
    }
  }
  return {};
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
  STEMVO_TRY(check_numbers(files, given));
  return check_names(files, given);
}

std::vector<double> count_frames(const std::vector<fs::path>& files,
                                 std::vector<std::string>& warnings) {
  std::vector<double> rises;
  bool is_count = files.size() > 1;
  for (std::size_t i = 1; i < files.size(); ++i) {
    const NameParts last = parts_of(files[i - 1]);
    const NameParts next = parts_of(files[i]);
    rises.push_back(std::strtod(next.number.c_str(), nullptr) -
                    std::strtod(last.number.c_str(), nullptr));
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
