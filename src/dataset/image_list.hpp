// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <string_view>
#include <vector>

#include "stemvo/error.hpp"

namespace stemvo::dataset {

/// Whether `a` comes before `b`: character by character, but whole numbers by their value, so that
/// frame2 comes before frame10. Of equals (frame2, frame02) the order of characters decides.
[[nodiscard]] bool comes_before(std::string_view a, std::string_view b);

/// `*` stands for any characters, `?` for one.
[[nodiscard]] bool matches_pattern(std::string_view name, std::string_view pattern);

/// Whether this is no path that exists and has * or ?.
[[nodiscard]] bool is_pattern(const std::filesystem::path& path);

struct ImageList {
  std::filesystem::path folder;
  std::vector<std::filesystem::path> files;  ///< in order; at least one
};

/// The .png, .jpg and .jpeg files of a folder, or those that a pattern names. Hidden files, whose
/// names start with a dot, are none of them. Errors: no such folder; wildcards elsewhere than in
/// the last part; none found.
[[nodiscard]] Expected<ImageList> list_images(const std::filesystem::path& folder_or_pattern);

}  // namespace stemvo::dataset
