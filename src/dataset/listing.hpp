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
  std::vector<std::filesystem::path> files;  ///< at least one
  std::vector<double> times_s;               ///< one per file, or none
  std::optional<std::filesystem::path> camera_file = std::nullopt;
  std::optional<std::filesystem::path> times_file = std::nullopt;
  std::optional<std::filesystem::path> ground_truth = std::nullopt;
};

/// A layout of files that is told by what lies in a folder.
struct Layout {
  bool (*is_layout_of)(const std::filesystem::path& folder);
  Expected<Listing> (*list)(const std::filesystem::path& folder);
};

/// EuRoC: `mav0`, its parent, or one camera of it (cam0, cam1): data.csv names the images of
/// data/ and their times in ns, sensor.yaml is the camera, state_groundtruth_estimate0/data.csv the
/// ground truth where it exists.
[[nodiscard]] Layout euroc_layout();
/// TUM RGB-D: rgb.txt names the images and their times in s, groundtruth.txt the ground truth. It
/// has no camera file of its own; camera.yaml in the folder is taken.
[[nodiscard]] Layout tum_layout();
/// Ours: camera.yaml in a folder of images, or beside its folder `images`; times.txt and poses.txt
/// where they exist.
[[nodiscard]] Layout own_layout();

/// A folder of images or a pattern, with nothing beside them.
[[nodiscard]] Expected<Listing> list_plain_images(const std::filesystem::path& folder_or_pattern);

}  // namespace stemvo::dataset
