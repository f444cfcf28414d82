// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "stemvo/error.hpp"

namespace stemvo::dataset {

/// The images of a recording in their order, and what lies beside them.
struct Listing {
  std::string kind;              ///< "EuRoC recording", "TUM RGB-D recording", "images"
  std::filesystem::path folder;  ///< of the images
  std::string name;
  std::vector<std::filesystem::path> files = {};  ///< at least one
  std::vector<double> times_s = {};               ///< one per file, or none
  std::string note = {};                          ///< how the times were found; may be empty
  std::string warning = {};                       ///< images that may be two of a time
  std::optional<std::filesystem::path> camera_file = std::nullopt;
  std::optional<std::filesystem::path> times_file = std::nullopt;
  std::optional<std::filesystem::path> ground_truth = std::nullopt;
};

/// The listing of a folder in one of these layouts; nullopt: another one, or none.
/// EuRoC: `mav0`, its parent, or one camera of it (cam0, cam1), whose data.csv has times in ns.
/// TUM RGB-D: rgb.txt, times in s, groundtruth.txt; camera.yaml in the folder is taken.
/// Ours: camera.yaml in a folder of images, or beside its folder `images`; times.txt and poses.txt
/// where they exist.
[[nodiscard]] std::optional<Expected<Listing>> find_listing(const std::filesystem::path& folder);

/// The .png, .jpg and .jpeg files of a folder, or those that a pattern names, but hidden ones.
/// Errors: no such folder; wildcards elsewhere than in the last part; none found; in a folder, two
/// of one number.
[[nodiscard]] Expected<Listing> list_images(const std::filesystem::path& folder_or_pattern);

[[nodiscard]] bool is_image_file(const std::filesystem::path& file);
/// Whether this is no path that exists and has *, ? or [.
[[nodiscard]] bool is_pattern(const std::filesystem::path& path);
/// The shell's patterns: `*` stands for any characters, `?` for one, `[0-4]` for one of these.
[[nodiscard]] bool matches_pattern(const std::string& name, const std::string& pattern);

}  // namespace stemvo::dataset
