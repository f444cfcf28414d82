// SPDX-License-Identifier: MIT
#include "dataset/png_file.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <fstream>
#include <vector>

#include <fmt/format.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "dataset/png_chunks.hpp"
#include "dataset/png_plain.hpp"

namespace stemvo::dataset {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::array<std::uint8_t, 8> kSignature = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
static_assert(kSignature.size() == kPngSignatureSize);

/// Each chunk must lie inside the file, the last is IEND.
Status check_complete(const Bytes& bytes, const std::string& name) {
  if (bytes.empty()) {
    return fail(fmt::format("{}: expected a PNG image, found an empty file", name));
  }
  if (bytes.size() < kSignature.size() ||
      !std::equal(kSignature.begin(), kSignature.end(), bytes.begin())) {
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

Expected<Bytes> read_bytes(const std::filesystem::path& file) {
  std::error_code code;
  std::ifstream stream(file, std::ios::binary);
  if (!stream || std::filesystem::is_directory(file, code)) {
    return fail(fmt::format("{}: expected a readable PNG image, cannot open it", file.string()));
  }
  const std::uintmax_t size = std::filesystem::file_size(file, code);
  Bytes bytes(code ? 0 : size);
  stream.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  bytes.resize(static_cast<std::size_t>(stream.gcount()));
  return bytes;
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

Expected<cv::Mat> read_png(const std::filesystem::path& file, bool as_color) {
  const auto bytes = read_bytes(file);
  if (!bytes) {
    return fail(bytes.error().message);
  }
  if (const Status complete = check_complete(*bytes, file.string()); !complete) {
    return fail(complete.error().message);
  }
  cv::Mat image = decode_plain_png(*bytes, as_color);
  if (image.empty()) {
    image = decode_any_png(*bytes, as_color);
  }
  if (image.empty()) {
    return fail(fmt::format("{}: expected a sound PNG image, found damaged data", file.string()));
  }
  return image;
}

}  // namespace stemvo::dataset
