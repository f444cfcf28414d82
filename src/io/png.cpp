// SPDX-License-Identifier: MIT
#include "io/png.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <memory>
#include <new>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>
#include <spng.h>

#include "internal_check.hpp"
#include "try.hpp"

namespace stemvo::io {
namespace {

using Context = std::unique_ptr<spng_ctx, decltype(&spng_ctx_free)>;

Context make_context(int flags) {
  Context context{spng_ctx_new(flags), &spng_ctx_free};
  if (context == nullptr) {
    throw std::bad_alloc();
  }
  // Chunks besides pixels stay small: a packed text of a megabyte would unpack to a gigabyte.
  constexpr std::size_t kMaxChunk = 1U << 23U;
  spng_set_chunk_limits(context.get(), kMaxChunk, kMaxChunk);
  return context;
}

/// Empty: damaged. Else 8 bits, gray or RGB, or 16 bits, gray or RGBA.
cv::Mat decode(spng_ctx& png, const spng_ihdr& header, bool keeps_16_bits) {
  const bool is_gray = header.color_type == SPNG_COLOR_TYPE_GRAYSCALE;
  const bool is_deep = header.bit_depth == 16 && keeps_16_bits;
  const bool is_plain_gray = is_gray && header.bit_depth <= 8;
  const spng_format format = is_deep         ? is_gray ? SPNG_FMT_PNG : SPNG_FMT_RGBA16
                             : is_plain_gray ? SPNG_FMT_G8
                                             : SPNG_FMT_RGB8;
  cv::Mat image(static_cast<int>(header.height), static_cast<int>(header.width),
                is_deep         ? CV_16UC(is_gray ? 1 : 4)
                : is_plain_gray ? CV_8UC1
                                : CV_8UC3);
  const bool is_sound =
      spng_decode_image(&png, image.data, image.total() * image.elemSize(), format, 0) == SPNG_OK &&
      spng_decode_chunks(&png) == SPNG_OK;
  return is_sound ? image : cv::Mat();
}

cv::Mat with_colors(const cv::Mat& image, bool as_color) {
  if (image.channels() == (as_color ? 3 : 1)) {
    return image;
  }
  cv::Mat result;
  cv::cvtColor(image, result,
               image.channels() == 1   ? cv::COLOR_GRAY2RGB
               : image.channels() == 3 ? cv::COLOR_RGB2GRAY
               : as_color              ? cv::COLOR_RGBA2RGB
                                       : cv::COLOR_RGBA2GRAY);
  return result;
}

}  // namespace

bool is_png(Bytes bytes) {
  constexpr std::array<std::uint8_t, 8> kSignature = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
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

Status check_size(const std::string& name, const cv::Size2l& found, const WantedSize& wanted) {
  constexpr std::int64_t kMaxPixels = 1 << 27;
  if (found.width > kMaxPixels || found.height > kMaxPixels || found.area() > kMaxPixels) {
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
  // The chunks' own checksums hold the pixels.
  const Context png = make_context(SPNG_CTX_IGNORE_ADLER32);
  spng_ihdr header{};
  cv::Mat image;
  if (spng_set_png_buffer(png.get(), bytes.data(), bytes.size()) == SPNG_OK &&
      spng_get_ihdr(png.get(), &header) == SPNG_OK) {
    STEMVO_TRY(check_size(name, {header.width, header.height}, wanted));
    image = decode(*png, header, keeps_16_bits);
  }
  if (image.empty()) {
    return fail(fmt::format("{}: expected a sound PNG image, found one damaged or cut off", name));
  }
  return with_colors(image, as_color);
}

std::string encode_png(const cv::Mat& image, bool is_fast) {
  STEMVO_CHECK(!image.empty() && image.isContinuous() &&
                   (image.type() == CV_8UC1 || image.type() == CV_8UC3),
               "an 8-bit image, gray or RGB");
  const Context png = make_context(SPNG_CTX_ENCODER);
  spng_ihdr header{};
  header.width = static_cast<std::uint32_t>(image.cols);
  header.height = static_cast<std::uint32_t>(image.rows);
  header.bit_depth = 8;
  header.color_type = image.channels() == 3 ? SPNG_COLOR_TYPE_TRUECOLOR : SPNG_COLOR_TYPE_GRAYSCALE;
  spng_set_ihdr(png.get(), &header);
  spng_set_option(png.get(), SPNG_ENCODE_TO_BUFFER, 1);
  if (is_fast) {
    spng_set_option(png.get(), SPNG_IMG_COMPRESSION_LEVEL, 1);
    spng_set_option(png.get(), SPNG_FILTER_CHOICE, SPNG_FILTER_CHOICE_UP);
  }
  std::size_t size = 0;
  int error = spng_encode_image(png.get(), image.data, image.total() * image.elemSize(),
                                SPNG_FMT_PNG, SPNG_ENCODE_FINALIZE);
  const std::unique_ptr<void, decltype(&std::free)> bytes{
      error == SPNG_OK ? spng_get_png_buffer(png.get(), &size, &error) : nullptr, &std::free};
  if (bytes == nullptr) {
    throw std::bad_alloc();  // nothing else can fail
  }
  return {static_cast<const char*>(bytes.get()), size};
}

}  // namespace stemvo::io
