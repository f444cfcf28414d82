// SPDX-License-Identifier: MIT
#include "io/png.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <memory>
#include <string_view>
#include <vector>

#include <fmt/format.h>
#include <libdeflate.h>

#include "try.hpp"

namespace stemvo::io {
namespace {

constexpr std::array<std::uint8_t, 8> kSignature = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};

/// The first four bytes.
std::uint32_t big_endian_32(Bytes bytes) {
  return (std::uint32_t{bytes[0]} << 24U) | (std::uint32_t{bytes[1]} << 16U) |
         (std::uint32_t{bytes[2]} << 8U) | std::uint32_t{bytes[3]};
}

/// PNG specification, section 5.3.
struct Chunk {
  std::string_view type;  ///< empty: there is no such chunk inside the file
  Bytes data;
  Bytes checked;               ///< type and data, which the checksum covers
  std::uint32_t checksum = 0;  ///< CRC-32, as it stands in the file

  [[nodiscard]] bool is_sound() const {
    return libdeflate_crc32(0, checked.data(), checked.size()) == checksum;
  }
};

/// Takes the next chunk off the `rest` of a file.
Chunk next_chunk(Bytes& rest) {
  constexpr std::size_t kFrame = 12;  // length, type and CRC, 4 bytes each
  if (rest.size() < kFrame || big_endian_32(rest) > rest.size() - kFrame) {
    return {};
  }
  const std::size_t length = big_endian_32(rest);
  const Bytes checked = rest.subspan(4, 4 + length);
  const Chunk chunk{{reinterpret_cast<const char*>(checked.data()), 4},
                    checked.subspan(4),
                    checked,
                    big_endian_32(rest.subspan(8 + length))};
  rest = rest.subspan(kFrame + length);
  return chunk;
}

/// IHDR (specification, section 11.2.2) of an image that is not interlaced.
bool is_plain_header(const Chunk& chunk, bool as_color) {
  constexpr std::uint8_t kGray = 0;
  constexpr std::uint8_t kRgb = 2;
  const std::array<std::uint8_t, 5> wanted = {8, as_color ? kRgb : kGray, 0, 0, 0};
  return chunk.type == "IHDR" && chunk.data.size() == 13 && chunk.is_sound() &&
         std::equal(wanted.begin(), wanted.end(), chunk.data.begin() + 8);
}

/// The parts of the zlib stream, one behind the other. False: a chunk that is damaged or may change
/// pixels, or something between those of the pixels, which libpng does not take.
bool collect_pixel_data(Bytes rest, std::vector<std::uint8_t>& packed) {
  /// Chunks that say something about the image and change no pixel of it.
  static constexpr std::array<std::string_view, 7> kHarmless = {"tEXt", "tIME", "pHYs", "gAMA",
                                                                "cHRM", "sRGB", "bKGD"};
  packed.clear();
  std::string_view before;
  bool has_pixels = false;
  for (Chunk chunk = next_chunk(rest); chunk.is_sound(); chunk = next_chunk(rest)) {
    if (chunk.type == "IEND") {
      return chunk.data.empty();
    }
    const bool is_pixels = chunk.type == "IDAT" && (before == "IDAT" || !has_pixels);
    if (is_pixels) {
      packed.insert(packed.end(), chunk.data.begin(), chunk.data.end());
      has_pixels = true;
    } else if (std::find(kHarmless.begin(), kHarmless.end(), chunk.type) == kHarmless.end()) {
      return false;
    }
    before = chunk.type;
  }
  return false;
}

/// One row: the filtered bytes, the row above, and where the row goes.
struct Row {
  const std::uint8_t* filtered;
  const std::uint8_t* above;
  std::uint8_t* out;
  std::size_t size;
};

/// The nearest of left, above and above left to left + above - above left.
int paeth(int left, int above, int above_left) {
  const int to_left = std::abs(above - above_left);
  const int to_above = std::abs(left - above_left);
  const int to_above_left = std::abs(left + above - 2 * above_left);
  const int best = to_left <= to_above ? left : above;
  return to_above_left < std::min(to_left, to_above) ? above_left : best;
}

/// Each byte plus what `predict` says by its neighbours; a pixel has kChannels bytes.
template <int kChannels, typename Predict>
void add_prediction(const Row& row, const Predict& predict) {
  std::array<int, kChannels> left{};
  std::array<int, kChannels> above_left{};
  for (std::size_t i = 0; i < row.size; i += kChannels) {
    for (std::size_t c = 0; c < kChannels; ++c) {
      const int above = row.above[i + c];
      const int value = row.filtered[i + c] + predict(left[c], above, above_left[c]);
      row.out[i + c] = static_cast<std::uint8_t>(value);
      left[c] = row.out[i + c];
      above_left[c] = above;
    }
  }
}

/// Section 9 of the specification. False: there is no such filter.
template <int kChannels>
bool undo_filter(int filter, const Row& row) {
  switch (filter) {
    case 0:
      std::copy_n(row.filtered, row.size, row.out);
      return true;
    case 1:
      add_prediction<kChannels>(row, [](int left, int, int) { return left; });
      return true;
    case 2:
      for (std::size_t i = 0; i < row.size; ++i) {
        row.out[i] = static_cast<std::uint8_t>(row.filtered[i] + row.above[i]);
      }
      return true;
    case 3:
      add_prediction<kChannels>(row, [](int left, int above, int) { return (left + above) / 2; });
      return true;
    case 4:
      add_prediction<kChannels>(row, paeth);
      return true;
    default:
      return false;
  }
}

/// `filtered`: per row of the image one byte that names the filter, then the row.
template <int kChannels>
cv::Mat undo_filters(const std::vector<std::uint8_t>& filtered, int rows, int cols) {
  cv::Mat image(rows, cols, CV_8UC(kChannels));
  const std::size_t row_size = filtered.size() / static_cast<std::size_t>(rows) - 1;
  const std::vector<std::uint8_t> zeros(row_size, 0);
  const std::uint8_t* above = zeros.data();
  const std::uint8_t* in = filtered.data();
  for (int v = 0; v < rows; ++v) {
    const Row row{in + 1, above, image.ptr(v), row_size};
    if (!undo_filter<kChannels>(*in, row)) {
      return {};
    }
    above = row.out;
    in += row_size + 1;
  }
  return image;
}

/// Kept from frame to frame.
struct Workspace {
  std::unique_ptr<libdeflate_decompressor, decltype(&libdeflate_free_decompressor)> decompressor{
      libdeflate_alloc_decompressor(), &libdeflate_free_decompressor};
  std::vector<std::uint8_t> packed;
  std::vector<std::uint8_t> unpacked;
};

}  // namespace

bool is_png(Bytes bytes) {
  return bytes.size() >= kSignature.size() &&
         std::equal(kSignature.begin(), kSignature.end(), bytes.begin());
}

bool is_color_png(Bytes bytes) {
  constexpr std::size_t kColorType = 25;  // of IHDR, which comes first
  constexpr std::uint8_t kColorBit = 2;
  return bytes.size() > kColorType && (bytes[kColorType] & kColorBit) != 0;
}

bool is_16_bit_png(Bytes bytes) {
  constexpr std::size_t kBitDepth = 24;  // of IHDR
  return is_png(bytes) && bytes.size() > kBitDepth && bytes[kBitDepth] == 16;
}

cv::Mat decode_plain_png(Bytes bytes, bool as_color) {
  constexpr std::uint64_t kMaxSide = 1U << 16U;
  constexpr std::uint64_t kMaxExpansion = 1032;  // deflate makes at most that many bytes of one
  thread_local Workspace work;
  Bytes rest = bytes.subspan(kSignature.size());
  const Chunk header = next_chunk(rest);
  if (work.decompressor == nullptr || !is_plain_header(header, as_color) ||
      !collect_pixel_data(rest, work.packed)) {
    return {};
  }
  const std::uint64_t cols = big_endian_32(header.data);
  const std::uint64_t rows = big_endian_32(header.data.subspan(4));
  const std::uint64_t unpacked_size = (cols * (as_color ? 3 : 1) + 1) * rows;
  if (cols == 0 || rows == 0 || cols > kMaxSide || rows > kMaxSide ||
      unpacked_size > kMaxExpansion * work.packed.size()) {
    return {};
  }
  work.unpacked.resize(unpacked_size);
  // Fills it exactly, or fails; compares the checksum of zlib.
  if (libdeflate_zlib_decompress(work.decompressor.get(), work.packed.data(), work.packed.size(),
                                 work.unpacked.data(), work.unpacked.size(),
                                 nullptr) != LIBDEFLATE_SUCCESS) {
    return {};
  }
  return (as_color ? undo_filters<3> : undo_filters<1>)(work.unpacked, static_cast<int>(rows),
                                                        static_cast<int>(cols));
}

Status check_size(const std::string& name, const DeclaredSize& found, const WantedSize& wanted) {
  constexpr std::int64_t kMaxPixels = 1 << 27;
  if (found.width > kMaxPixels || found.height > kMaxPixels ||
      found.width * found.height > kMaxPixels) {
    return fail(fmt::format("{}: expected an image of at most {} pixels, found {}x{}", name,
                            kMaxPixels, found.width, found.height));
  }
  if (wanted && (found.width != wanted->width || found.height != wanted->height)) {
    return fail(fmt::format("{}: expected an image of {}x{} pixels, found {}x{}", name,
                            wanted->width, wanted->height, found.width, found.height));
  }
  return {};
}

Expected<cv::Mat> decode_png(Bytes bytes,
                             const std::string& name,
                             bool as_color,
                             const WantedSize& wanted,
                             bool keeps_16_bits) {
  Bytes rest = bytes.subspan(kSignature.size());
  const Chunk header = next_chunk(rest);
  if (header.type == "IHDR" && header.data.size() >= 8) {
    const DeclaredSize size{big_endian_32(header.data), big_endian_32(header.data.subspan(4))};
    STEMVO_TRY(check_size(name, size, wanted));
  }
  cv::Mat image = decode_plain_png(bytes, as_color);
  if (image.empty()) {
    image = decode_any_png(bytes, as_color, keeps_16_bits);
  }
  if (image.empty()) {
    return fail(fmt::format("{}: expected a sound PNG image, found one damaged or cut off", name));
  }
  return image;
}

}  // namespace stemvo::io
