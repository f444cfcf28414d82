// SPDX-License-Identifier: MIT
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "stem/onnx_session.hpp"
#include "stemvo/error.hpp"
#include "stemvo/options.hpp"

using EVP_MD_CTX = struct evp_md_ctx_st;  // libcrypto's

namespace stemvo::internal {

/// SHA-256 as 64 lower-case hexadecimal digits.
[[nodiscard]] std::string sha256_hex(std::string_view bytes);

/// The same of many texts with one beginning, which is hashed once.
class Sha256 {
 public:
  explicit Sha256(std::string_view beginning);
  [[nodiscard]] std::string hex(std::string_view rest) const;

 private:
  std::shared_ptr<EVP_MD_CTX> state_;
};

/// What a network's numbers are at most: whole images, for typing errors.
inline constexpr int kMaxKernel_px = 4096;
inline constexpr int kMaxStride_px = 256;
inline constexpr int kMaxFilters = 4096;

/// The default network, which is part of the library: its files are names for messages.
[[nodiscard]] StemNetwork built_in_network();

/// The file of one filter as a model of its own, of a network that has one.
[[nodiscard]] StemNetwork folded_network(const StemNetwork& network);

/// Reads, hashes and loads the file, and holds the graph against the network: hash, number of
/// filters, stride and sizes of channels; where it may be sampled more densely, also that an output
/// depends on the pixels of the window of kernel, stride and padding and on no others. So the pixel
/// map is right, and passes over a shifted frame agree (a graph that normalises over the whole
/// image, say, is refused).
[[nodiscard]] Expected<OnnxSession> open_model(const StemNetwork& network);
/// The same of built_in_network(), or of its one filter.
[[nodiscard]] Expected<OnnxSession> open_built_in_model(const StemNetwork& network);

}  // namespace stemvo::internal
