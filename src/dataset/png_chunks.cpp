// SPDX-License-Identifier: MIT
#include "dataset/png_chunks.hpp"

namespace stemvo::dataset {

std::uint32_t big_endian_32(std::span<const std::uint8_t> bytes) {
  return (std::uint32_t{bytes[0]} << 24U) | (std::uint32_t{bytes[1]} << 16U) |
         (std::uint32_t{bytes[2]} << 8U) | std::uint32_t{bytes[3]};
}

PngChunk PngChunks::next() {
  constexpr std::size_t kTypeSize = 4;
  constexpr std::size_t kFrame = 12;  // length, type and CRC, 4 bytes each
  if (rest_.size() < kFrame || big_endian_32(rest_) > rest_.size() - kFrame) {
    rest_ = {};
    return {};
  }
  const std::size_t length = big_endian_32(rest_);
  PngChunk chunk;
  chunk.checked = rest_.subspan(4, kTypeSize + length);
  chunk.type = {reinterpret_cast<const char*>(chunk.checked.data()), kTypeSize};
  chunk.data = chunk.checked.subspan(kTypeSize);
  chunk.checksum = big_endian_32(rest_.subspan(kFrame - 4 + length));
  rest_ = rest_.subspan(kFrame + length);
  return chunk;
}

}  // namespace stemvo::dataset
