// SPDX-License-Identifier: MIT
#include "dataset/png_file.hpp"

#include <algorithm>
#include <array>
#include <cstdint>

#include <fmt/format.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "dataset/png_chunks.hpp"
#include "dataset/png_plain.hpp"

namespace stemvo::dataset {
namespace {

constexpr std::array<std::uint8_t, 8> kSignature = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
static_assert(kSignature.size() == kPngSignatureSize);

/// Each chunk must lie inside the file, the last is IEND.
Status check_complete(const Bytes& bytes, const std::string& name) {
  if (bytes.empty()) {
    return fail(fmt::format("{}: expected a PNG image, found an empty file", name));
  }
  if (!is_png(bytes)) {
    return fail(fmt::format("{}: expected a PNG image, found another kind of file", name));
  }
  PngChunks chunks(bytes);
  for (PngChunk chunk = chunks.next(); !chunk.type.empty(); chunk = chunks.next()) {
    if (chunk.type == "IEND") {
      return {};
    }
  }
  return fail(fmt::format("{}: expected a complete PNG image, found one cut off after {} bytes",
                          name, bytes.size()));
}

/// Every kind of PNG.
cv::Mat decode_any_png(const Bytes& bytes, bool as_color) {
  cv::Mat image;
  try {
    image = cv::imdecode(bytes, as_color ? cv::IMREAD_COLOR : cv::IMREAD_GRAYSCALE);
  } catch (const cv::Exception&) {
    return {};
  }
  if (as_color && !image.empty()) {
    cv::cvtColor(image, image, cv::COLOR_BGR2RGB);
  }
  return image;
}

}  // namespace

bool is_png(const Bytes& bytes) {
  return bytes.size() >= kSignature.size() &&
         std::equal(kSignature.begin(), kSignature.end(), bytes.begin());
}

bool is_color_png(const Bytes& bytes) {
  constexpr std::size_t kColorType = 25;  // of IHDR, which comes first
  constexpr std::uint8_t kColorBit = 2;
  return bytes.size() > kColorType && (bytes[kColorType] & kColorBit) != 0;
}

Expected<cv::Mat> decode_png(const Bytes& bytes, const std::string& name, bool as_color) {
  if (const Status complete = check_complete(bytes, name); !complete) {
    return fail(complete.error().message);
  }
  cv::Mat image = decode_plain_png(bytes, as_color);
  if (image.empty()) {
    image = decode_any_png(bytes, as_color);
  }
  if (image.empty()) {
    return fail(fmt::format("{}: expected a sound PNG image, found damaged data", name));
  }
  return image;
}

Expected<cv::Mat> read_png(const std::filesystem::path& file, bool as_color) {
  const auto bytes = read_bytes(file, "PNG image");
  if (!bytes) {
    return fail(bytes.error().message);
  }
  return decode_png(*bytes, file.string(), as_color);
}

}  // namespace stemvo::dataset
