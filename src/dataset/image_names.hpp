// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "stemvo/error.hpp"

namespace stemvo::dataset {

/// Character by character, but whole numbers by their value: frame2 comes before frame10. With
/// `has_decimals` digits behind "7." are its decimals: 5.25 comes before 5.3.
[[nodiscard]] bool comes_before(std::string_view a, std::string_view b, bool has_decimals = false);
/// So; the names tell whether they have decimals.
void sort_images(std::vector<std::filesystem::path>& files);

/// How many steps each frame is behind the first, by the numbers in the names where most follow
/// each other, else evenly. A warning: numbers are missing.
[[nodiscard]] std::vector<double> count_frames(const std::vector<std::filesystem::path>& files,
                                               std::vector<std::string>& warnings);
/// Error, of what was `given`: the files are of several cameras, or one picture twice.
[[nodiscard]] Status check_image_names(const std::vector<std::filesystem::path>& files,
                                       const std::filesystem::path& given);
/// An image without a number among those that have one: a mask, a picture of the board. Empty:
/// none.
[[nodiscard]] std::string warn_of_names(const std::vector<std::filesystem::path>& files);

}  // namespace stemvo::dataset
