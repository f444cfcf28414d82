// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

namespace stemvo::dataset {

inline constexpr std::size_t kPngSignatureSize = 8;

/// The first four of them.
[[nodiscard]] std::uint32_t big_endian_32(std::span<const std::uint8_t> bytes);

/// PNG specification, section 5.3.
struct PngChunk {
  std::string_view type;                  ///< empty: there is no such chunk inside the file
  std::span<const std::uint8_t> data;     //
  std::span<const std::uint8_t> checked;  ///< type and data: what the checksum is of
  std::uint32_t checksum = 0;             ///< CRC-32, as it stands in the file
};

/// Walks the chunks of a file that starts with PNG's signature.
class PngChunks {
 public:
  explicit PngChunks(std::span<const std::uint8_t> file) : rest_(file.subspan(kPngSignatureSize)) {}
  /// An empty type where the next one does not lie inside the file, then and ever after.
  [[nodiscard]] PngChunk next();

 private:
  std::span<const std::uint8_t> rest_;
};

}  // namespace stemvo::dataset
