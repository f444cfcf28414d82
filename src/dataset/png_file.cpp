// SPDX-License-Identifier: MIT
#include "dataset/png_file.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <fstream>
#include <iterator>
#include <string_view>
#include <vector>

#include <fmt/format.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

namespace stemvo::dataset {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::array<std::uint8_t, 8> kSignature = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
constexpr std::size_t kChunkFrame = 12;  // length, type and CRC, 4 bytes each

std::uint64_t big_endian_32(const Bytes& bytes, std::size_t at) {
  return (std::uint64_t{bytes[at]} << 24) | (std::uint64_t{bytes[at + 1]} << 16) |
         (std::uint64_t{bytes[at + 2]} << 8) | std::uint64_t{bytes[at + 3]};
}

/// Walks the chunks (PNG specification, section 5): each must lie inside the file, the last is
/// IEND.
Status check_complete(const Bytes& bytes, const std::string& name) {
  if (bytes.empty()) {
    return fail(fmt::format("{}: expected a PNG image, found an empty file", name));
  }
  if (bytes.size() < kSignature.size() ||
      !std::equal(kSignature.begin(), kSignature.end(), bytes.begin())) {
    return fail(fmt::format("{}: expected a PNG image, found another kind of file", name));
  }
  for (std::size_t at = kSignature.size(); at + kChunkFrame <= bytes.size();) {
    const std::uint64_t length = big_endian_32(bytes, at);
    const std::string_view type(reinterpret_cast<const char*>(bytes.data()) + at + 4, 4);
    if (length > bytes.size() - at - kChunkFrame) {
      break;
    }
    if (type == "IEND") {
      return {};
    }
    at += kChunkFrame + length;
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
  Bytes bytes;
  bytes.reserve(std::filesystem::file_size(file, code));
  bytes.assign(std::istreambuf_iterator<char>(stream), {});
  return bytes;
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
  cv::Mat image;
  try {
    image = cv::imdecode(*bytes, as_color ? cv::IMREAD_COLOR : cv::IMREAD_GRAYSCALE);
  } catch (const cv::Exception&) {
    image.release();  // the one message below says what is known
  }
  if (image.empty()) {
    return fail(fmt::format("{}: expected a sound PNG image, found damaged data", file.string()));
  }
  if (as_color) {
    cv::cvtColor(image, image, cv::COLOR_BGR2RGB);
  }
  return image;
}

}  // namespace stemvo::dataset
