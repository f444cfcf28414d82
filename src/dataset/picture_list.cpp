// SPDX-License-Identifier: MIT
#include "dataset/picture_list.hpp"

#include <algorithm>
#include <cctype>
#include <string>
#include <system_error>

#include <fmt/format.h>

#include "dataset/frame_files.hpp"

namespace stemvo::dataset {
namespace {

namespace fs = std::filesystem;

constexpr const char* kWildcards = "*?";

bool is_digit(char c) { return c >= '0' && c <= '9'; }

bool has_wildcards(const fs::path& path) {
  return path.string().find_first_of(kWildcards) != std::string::npos;
}

/// The digits at the front without leading zeros; all of them are taken off `text`.
std::string_view take_number(std::string_view& text) {
  const std::size_t end =
      static_cast<std::size_t>(std::find_if_not(text.begin(), text.end(), is_digit) - text.begin());
  std::string_view number = text.substr(0, end);
  text.remove_prefix(end);
  number.remove_prefix(std::min(number.find_first_not_of('0'), number.size()));
  return number;
}

/// Below, at or above zero, as a comes before b.
int compare_numbers(std::string_view& a, std::string_view& b) {
  const std::string_view first = take_number(a);
  const std::string_view second = take_number(b);
  if (first.size() != second.size()) {
    return first.size() < second.size() ? -1 : 1;
  }
  return first.compare(second);
}

bool has_picture_name(const fs::path& file) {
  std::string extension = file.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return !file.filename().string().starts_with('.') &&
         (extension == ".png" || extension == ".jpg" || extension == ".jpeg");
}

/// Which files of which folder.
struct Place {
  fs::path folder;
  std::string pattern;
};

Expected<Place> find_place(const fs::path& given) {
  if (!is_pattern(given)) {
    if (!is_folder(given)) {
      return fail(
          fmt::format("{}: expected a folder of pictures or a pattern with * or ?, found "
                      "none",
                      given.string()));
    }
    return Place{given, "*"};
  }
  const fs::path parent = given.has_parent_path() ? given.parent_path() : fs::path(".");
  if (is_pattern(parent)) {
    return fail(fmt::format("{}: expected * and ? in the last part only, found them in '{}'",
                            given.string(), parent.string()));
  }
  if (!is_folder(parent)) {
    return fail(fmt::format("{}: expected a folder of pictures, found none", parent.string()));
  }
  return Place{parent, given.filename().string()};
}

}  // namespace

bool comes_before(std::string_view a, std::string_view b) {
  std::string_view rest_a = a;
  std::string_view rest_b = b;
  while (!rest_a.empty() && !rest_b.empty()) {
    if (is_digit(rest_a.front()) && is_digit(rest_b.front())) {
      if (const int order = compare_numbers(rest_a, rest_b); order != 0) {
        return order < 0;
      }
    } else if (rest_a.front() != rest_b.front()) {
      return rest_a.front() < rest_b.front();
    } else {
      rest_a.remove_prefix(1);
      rest_b.remove_prefix(1);
    }
  }
  return rest_a.empty() == rest_b.empty() ? a < b : rest_a.empty();
}

bool matches_pattern(std::string_view name, std::string_view pattern) {
  std::size_t at = 0;
  std::size_t in_pattern = 0;
  std::size_t star = std::string_view::npos;  // the last one met, which may stand for more
  std::size_t after_star = 0;                 // of the name, where its rest starts
  while (at < name.size()) {
    if (in_pattern < pattern.size() && pattern[in_pattern] == '*') {
      star = in_pattern++;
      after_star = at;
    } else if (in_pattern < pattern.size() &&
               (pattern[in_pattern] == '?' || pattern[in_pattern] == name[at])) {
      ++in_pattern;
      ++at;
    } else if (star != std::string_view::npos) {
      in_pattern = star + 1;
      at = ++after_star;
    } else {
      return false;
    }
  }
  return pattern.find_first_not_of('*', in_pattern) == std::string_view::npos;
}

bool is_pattern(const fs::path& path) {
  std::error_code code;
  return has_wildcards(path) && !fs::exists(path, code);
}

Expected<PictureList> list_pictures(const fs::path& folder_or_pattern) {
  const Expected<Place> place = find_place(folder_or_pattern);
  if (!place) {
    return place.error();
  }
  std::vector<std::string> names;
  std::error_code code;
  fs::directory_iterator entry(place->folder, code);
  for (; !code && entry != fs::directory_iterator(); entry.increment(code)) {
    const std::string name = entry->path().filename().string();
    if (has_picture_name(name) && matches_pattern(name, place->pattern) &&
        !is_folder(entry->path())) {
      names.push_back(name);
    }
  }
  if (code) {
    return fail(
        fmt::format("{}: cannot list the folder: {}", place->folder.string(), code.message()));
  }
  if (names.empty()) {
    return fail(fmt::format("{}: expected pictures (.png, .jpg, .jpeg), found none",
                            folder_or_pattern.string()));
  }
  std::sort(names.begin(), names.end(),
            [](const std::string& a, const std::string& b) { return comes_before(a, b); });
  PictureList result{place->folder, {}};
  for (const std::string& name : names) {
    result.files.push_back(place->folder / name);
  }
  return result;
}

}  // namespace stemvo::dataset
