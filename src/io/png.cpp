// SPDX-License-Identifier: MIT
#include "io/png.hpp"

#include <algorithm>
#include <array>
#include <csetjmp>
#include <cstdlib>
#include <memory>
#include <new>
#include <string_view>
#include <vector>

#include <fmt/format.h>
#include <libdeflate.h>
#include <png.h>

#include "internal_check.hpp"
#include "try.hpp"

namespace stemvo::io {
namespace {

constexpr std::array<std::uint8_t, 8> kSignature = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};

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

struct Workspace {
  std::unique_ptr<libdeflate_decompressor, decltype(&libdeflate_free_decompressor)> decompressor{
      libdeflate_alloc_decompressor(), &libdeflate_free_decompressor};
  std::vector<std::uint8_t> packed;
  std::vector<std::uint8_t> unpacked;
};

/// libpng's state and what it fills. libpng leaves a call that fails by longjmp: past `read`, which
/// owns nothing.
class LibpngReader {
 public:
  LibpngReader(Bytes bytes, bool is_deep)
      : rest_(bytes),
        is_deep_(is_deep),
        png_(png_create_read_struct_2(
            PNG_LIBPNG_VER_STRING,
            nullptr,
            &fail,
            [](auto...) {},
            nullptr,
            &allocate,
            [](png_structp, png_voidp memory) { std::free(memory); })),
        info_(png_ != nullptr ? png_create_info_struct(png_) : nullptr) {
    if (info_ == nullptr) {
      throw std::bad_alloc();
    }
    png_set_read_fn(png_, this, &give);
  }
  ~LibpngReader() { png_destroy_read_struct(&png_, &info_, nullptr); }
  LibpngReader(const LibpngReader&) = delete;
  LibpngReader& operator=(const LibpngReader&) = delete;

  /// Empty: damaged.
  [[nodiscard]] cv::Mat decode(bool as_color) { return read(as_color) ? image_ : cv::Mat(); }

 private:
  bool read(bool as_color) {
    if (setjmp(png_jmpbuf(png_)) != 0) {
      return false;
    }
    png_read_info(png_, info_);
    choose_output(as_color);
    image_.create(static_cast<int>(png_get_image_height(png_, info_)),
                  static_cast<int>(png_get_image_width(png_, info_)),
                  CV_MAKETYPE(is_deep_ ? CV_16U : CV_8U, as_color ? 3 : 1));
    for (int v = 0; v < image_.rows; ++v) {
      rows_.push_back(image_.ptr(v));
    }
    png_read_image(png_, rows_.data());
    png_read_end(png_, nullptr);
    return true;
  }
  void choose_output(bool as_color) {
    const bool is_color = (png_get_color_type(png_, info_) & PNG_COLOR_MASK_COLOR) != 0;
    png_set_expand(png_);
    if (is_deep_) {
      png_set_swap(png_);  // PNG's bytes are in the other order than a PC's
    } else {
      png_set_strip_16(png_);
    }
    png_set_strip_alpha(png_);
    if (as_color && !is_color) {
      png_set_gray_to_rgb(png_);
    } else if (!as_color && is_color) {
      png_set_rgb_to_gray(png_, PNG_ERROR_ACTION_NONE, 0.299, 0.587);  // ITU-R BT.601
    }
    png_set_interlace_handling(png_);
    png_read_update_info(png_, info_);
  }
  /// libpng 1.6.39 allocates what a chunk's length claims before it reads it, and only warns where
  /// that is over png_set_chunk_malloc_max. Rows of the widest image take half a MiB.
  static png_voidp allocate(png_structp /*png*/, png_alloc_size_t size) {
    constexpr png_alloc_size_t kMaxSize = 1U << 23U;
    return size > kMaxSize ? nullptr : std::malloc(size);
  }
  [[noreturn]] static void fail(png_structp png, png_const_charp /*message*/) {
    png_longjmp(png, 1);
  }
  static void give(png_structp png, png_bytep to, std::size_t size) {
    Bytes& rest = static_cast<LibpngReader*>(png_get_io_ptr(png))->rest_;
    if (size > rest.size()) {
      png_error(png, "cut off");
    }
    std::copy_n(rest.begin(), size, to);
    rest = rest.subspan(size);
  }

  Bytes rest_;
  bool is_deep_;
  cv::Mat image_;
  std::vector<png_bytep> rows_;
  png_structp png_;
  png_infop info_;
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

cv::Mat decode_any_png(Bytes bytes, bool as_color, bool keeps_16_bits) {
  return LibpngReader(bytes, keeps_16_bits && is_16_bit_png(bytes)).decode(as_color);
}

std::string encode_png(const cv::Mat& image, bool is_fast) {
  STEMVO_CHECK(!image.empty() && image.isContinuous() &&
                   (image.type() == CV_8UC1 || image.type() == CV_8UC3),
               "an 8-bit image, gray or RGB");
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  png.width = static_cast<png_uint_32>(image.cols);
  png.height = static_cast<png_uint_32>(image.rows);
  png.format = image.channels() == 3 ? PNG_FORMAT_RGB : PNG_FORMAT_GRAY;
  png.flags = is_fast ? PNG_IMAGE_FLAG_FAST : 0;
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(png);
  std::string bytes(size, '\0');
  if (png_image_write_to_memory(&png, bytes.data(), &size, 0, image.data, 0, nullptr) == 0) {
    throw std::bad_alloc();  // nothing else can fail
  }
  bytes.resize(size);
  return bytes;
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
