// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "stemvo/error.hpp"

namespace stemvo {

/// One entry of models/manifest.yaml.
struct ModelEntry {
  std::string name;
  std::filesystem::path file;  ///< absolute
  std::string sha256;
  std::string network;  ///< e.g. "EfficientNetV2-B0"
  std::string layer;    ///< e.g. "stem_conv"
  int num_filters = 0;
  std::array<int, 2> kernel_px{};  ///< y, x
  int stride_px = 0;
  std::array<int, 4> padding_px{};  ///< top, left, bottom, right, inside the graph
  int default_filter = 0;
  std::string licence;
  std::string command;  ///< that produced the file
};

/// Reads a manifest; unknown, missing and duplicated keys are errors with file and line.
[[nodiscard]] Expected<std::vector<ModelEntry>> load_manifest(const std::filesystem::path& file);

/// What `stemvo models` shows: whether a file is there, has its hash, loads, and has the shapes the
/// manifest says. The error is the first thing that is wrong.
[[nodiscard]] Status check_model(const ModelEntry& entry);

}  // namespace stemvo
