// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "stemvo/error.hpp"

namespace stemvo {

/// A file of one filter alone: the same values as the model's, at less cost. Its graph has the
/// model's kernel and padding, and stride `sampling_px`.
struct FoldedFilter {
  int filter = 0;
  int sampling_px = 1;
  std::filesystem::path file;  ///< absolute
  std::string sha256;
};

/// One entry of models/manifest.yaml: a layer of a model. The layers of one model have the same
/// name and file; the graph's outputs are called like them (a model of one layer: also `channels`).
struct ModelEntry {
  std::string name;
  std::filesystem::path file;  ///< absolute
  std::string sha256;
  std::string network;  ///< e.g. "EfficientNetV2-B0"
  std::string layer;    ///< e.g. "stem_conv"; also the graph's output
  int num_filters = 0;
  std::array<int, 2> kernel_px{};  ///< y, x
  int stride_px = 0;
  std::array<int, 4> padding_px{};  ///< top, left, bottom, right, inside the graph
  /// Key `sampling: native` (default `any`): a deeper layer, padded inside or seeing more than its
  /// window, so that passes over a shifted frame would not fit together. Kernel and padding then
  /// are those of one convolution with the same centre and the same sizes of channels.
  bool native_sampling_only = false;
  int default_filter = 0;
  /// Key `folded: {filter, sampling, file, sha256}`, where there is one.
  std::optional<FoldedFilter> folded;
  std::string licence;
  std::string command;  ///< that produced the file
};

/// Reads a manifest; unknown, missing and duplicated keys are errors with file and line.
[[nodiscard]] Expected<std::vector<ModelEntry>> load_manifest(const std::filesystem::path& file);

/// The layers of a model, in the manifest's order, for StemOptions::layer; `model` as in
/// StemOptions (not gray or input_layer). Errors: no manifest, unknown name (lists the known ones),
/// a file the manifest does not list. The model's file is not opened.
[[nodiscard]] Expected<std::vector<ModelEntry>> find_layers(
    const std::string& model, const std::filesystem::path& models_dir);

/// What `stemvo models` shows: whether a file is there, has its hash, loads, and has the shapes the
/// manifest says. The error is the first thing that is wrong.
[[nodiscard]] Status check_model(const ModelEntry& entry);

}  // namespace stemvo
