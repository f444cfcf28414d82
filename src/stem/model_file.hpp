// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "stem/onnx_session.hpp"
#include "stemvo/error.hpp"
#include "stemvo/options.hpp"

namespace stemvo::internal {

/// SHA-256 as 64 lower-case hexadecimal digits.
[[nodiscard]] std::string sha256_hex(std::string_view bytes);

/// The default network, whose files are part of the library.
[[nodiscard]] StemNetwork built_in_network();

/// The file of one filter as a model of its own, where the network has one.
[[nodiscard]] std::optional<StemNetwork> folded_network(const StemNetwork& network);

/// Reads, hashes and loads the file, and holds the graph against the network: hash, number of
/// filters, kernel, stride and padding (window_check.hpp).
[[nodiscard]] Expected<OnnxSession> open_model(const StemNetwork& network);

}  // namespace stemvo::internal
