// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "stem/onnx_session.hpp"
#include "stemvo/error.hpp"
#include "stemvo/stem/manifest.hpp"

namespace stemvo::internal {

/// The whole of a file. Error: it cannot be read.
[[nodiscard]] Expected<std::string> read_bytes(const std::filesystem::path& file);

/// SHA-256 as 64 lower-case hexadecimal digits.
[[nodiscard]] std::string sha256_hex(std::string_view bytes);

/// The manifest's entry for a layer of `model`: a name in models_dir/manifest.yaml, or the path of
/// an .onnx that a manifest.yaml beside it lists. Layer `first`: its first. Errors: those of
/// find_layers, unknown layer (lists the known ones).
[[nodiscard]] Expected<ModelEntry> find_model(const std::string& model,
                                              const std::string& layer,
                                              const std::filesystem::path& models_dir);

/// The file of one filter as a model of its own, where the entry has one.
[[nodiscard]] std::optional<ModelEntry> folded_entry(const ModelEntry& entry);

/// Reads, hashes and loads the file, and holds the graph against the entry: hash, number of
/// filters, kernel, stride and padding (window_check.hpp).
[[nodiscard]] Expected<OnnxSession> open_model(const ModelEntry& entry);

}  // namespace stemvo::internal
