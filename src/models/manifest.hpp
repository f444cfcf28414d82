// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "stem/stem.hpp"
#include "stemvo/error.hpp"
#include "stemvo/options.hpp"

namespace stemvo {

/// One entry of models/manifest.yaml: a layer of a model. The layers of one model have the same
/// name and file; the graph's outputs are called like them (a model of one layer: also `channels`).
/// Files are absolute, hashes given. Key `sampling: native` (default `any`): native_sampling_only;
/// key `folded: {filter, sampling, file, sha256}`, where there is one.
struct ModelEntry : StemNetwork {
  std::string network;  ///< e.g. "EfficientNetV2-B0"
  std::string licence;
  std::string command;  ///< that produced the file
};

/// Reads a manifest; unknown, missing and duplicated keys are errors with file and line.
[[nodiscard]] Expected<std::vector<ModelEntry>> load_manifest(const std::filesystem::path& file);

/// The layers of a model, in the manifest's order, for StemOptions::layer; `model` as in
/// StemOptions (not one made by hand). Errors: no manifest, unknown name (lists the known ones),
/// a file the manifest does not list. The model's file is not opened.
[[nodiscard]] Expected<std::vector<ModelEntry>> find_layers(
    const std::string& model, const std::filesystem::path& models_dir);

/// The same for one layer; `first`: its first. Error: unknown layer (lists the known ones).
[[nodiscard]] Expected<ModelEntry> find_model(const std::string& model,
                                              const std::string& layer,
                                              const std::filesystem::path& models_dir);

/// The options with the network that `model` and `layer` name; errors as find_model.
[[nodiscard]] Expected<StemOptions> with_network(StemOptions options,
                                                 const std::filesystem::path& models_dir);

/// Stem::create_all of what with_network gives; errors of both.
[[nodiscard]] Expected<Stem> create_stem(const StemOptions& options,
                                         const std::filesystem::path& models_dir);

/// What `stemvo models` shows: whether a file is there, has its hash, loads, and has the shapes the
/// manifest says. The error is the first thing that is wrong.
[[nodiscard]] Status check_model(const ModelEntry& entry);

}  // namespace stemvo
