// SPDX-License-Identifier: MIT
#include "dataset/png_plain.hpp"

#include <algorithm>
#include <array>
#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include <libdeflate.h>

#include "dataset/png_chunks.hpp"
#include "dataset/png_filters.hpp"

namespace stemvo::dataset {
namespace {

/// Chunks that say something about the picture and change no pixel of it.
constexpr std::array<std::string_view, 7> kHarmless = {"tEXt", "tIME", "pHYs", "gAMA",
                                                       "cHRM", "sRGB", "bKGD"};
/// Deflate makes at most 1032 bytes of one: a header that promises more is wrong.
constexpr std::uint64_t kMaxExpansion = 1032;

using Bytes = std::span<const std::uint8_t>;

struct Plain {
  int rows = 0;
  int cols = 0;
  Bytes packed;  ///< the zlib stream

  [[nodiscard]] std::uint64_t unpacked_size(int channels) const {
    return (static_cast<std::uint64_t>(cols) * static_cast<std::uint64_t>(channels) + 1) *
           static_cast<std::uint64_t>(rows);
  }
};

/// Kept from frame to frame.
struct Workspace {
  std::unique_ptr<libdeflate_decompressor, decltype(&libdeflate_free_decompressor)> decompressor{
      libdeflate_alloc_decompressor(), &libdeflate_free_decompressor};
  std::vector<std::uint8_t> packed;
  std::vector<std::uint8_t> unpacked;
};

bool has_right_checksum(const PngChunk& chunk) {
  return libdeflate_crc32(0, chunk.checked.data(), chunk.checked.size()) == chunk.checksum;
}

/// IHDR (specification, section 11.2.2) of a picture that is not interlaced.
bool is_plain_header(const PngChunk& chunk, bool as_color) {
  constexpr std::size_t kHeaderSize = 13;
  constexpr std::uint8_t kGray = 0;
  constexpr std::uint8_t kRgb = 2;
  if (chunk.type != "IHDR" || chunk.data.size() != kHeaderSize || !has_right_checksum(chunk)) {
    return false;
  }
  const std::array<std::uint8_t, 5> wanted = {8, as_color ? kRgb : kGray, 0, 0, 0};
  return std::equal(wanted.begin(), wanted.end(), chunk.data.begin() + 8);
}

std::optional<Plain> find_plain(Bytes file, bool as_color, std::vector<std::uint8_t>& packed) {
  constexpr std::uint64_t kMaxSide = 1U << 16U;
  PngChunks chunks(file);
  const PngChunk header = chunks.next();
  if (!is_plain_header(header, as_color)) {
    return std::nullopt;
  }
  const std::uint64_t cols = big_endian_32(header.data);
  const std::uint64_t rows = big_endian_32(header.data.subspan(4));
  if (cols == 0 || rows == 0 || cols > kMaxSide || rows > kMaxSide) {
    return std::nullopt;
  }
  packed.clear();
  for (PngChunk chunk = chunks.next(); chunk.type != "IEND"; chunk = chunks.next()) {
    if (chunk.type == "IDAT" && has_right_checksum(chunk)) {
      packed.insert(packed.end(), chunk.data.begin(), chunk.data.end());
    } else if (std::find(kHarmless.begin(), kHarmless.end(), chunk.type) == kHarmless.end()) {
      return std::nullopt;
    }
  }
  return Plain{static_cast<int>(rows), static_cast<int>(cols), packed};
}

}  // namespace

cv::Mat decode_plain_png(std::span<const std::uint8_t> bytes, bool as_color) {
  thread_local Workspace work;
  const int channels = as_color ? 3 : 1;
  const std::optional<Plain> plain = find_plain(bytes, as_color, work.packed);
  if (!plain || work.decompressor == nullptr ||
      plain->unpacked_size(channels) > kMaxExpansion * plain->packed.size()) {
    return {};
  }
  work.unpacked.resize(plain->unpacked_size(channels));
  // Fills it exactly, or fails; compares the checksum of zlib.
  if (libdeflate_zlib_decompress(work.decompressor.get(), plain->packed.data(),
                                 plain->packed.size(), work.unpacked.data(), work.unpacked.size(),
                                 nullptr) != LIBDEFLATE_SUCCESS) {
    return {};
  }
  cv::Mat image(plain->rows, plain->cols, CV_8UC(channels));
  return undo_png_filters(work.unpacked, image) ? image : cv::Mat();
}

}  // namespace stemvo::dataset
