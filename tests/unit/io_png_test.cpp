// SPDX-License-Identifier: MIT
#include <libdeflate.h>

#include "io/image_file.hpp"
#include "io/png.hpp"
#include "support/test.hpp"

namespace stemvo::io {
namespace {

using Bytes = std::vector<std::uint8_t>;

void add_be32(Bytes& bytes, std::size_t value) {
  for (int shift = 24; shift >= 0; shift -= 8) {
    bytes.push_back(static_cast<std::uint8_t>(value >> static_cast<unsigned>(shift)));
  }
}

void add_chunk(Bytes& png, const std::string& type, const Bytes& data) {
  add_be32(png, data.size());
  Bytes checked(type.begin(), type.end());
  checked.insert(checked.end(), data.begin(), data.end());
  png.insert(png.end(), checked.begin(), checked.end());
  add_be32(png, libdeflate_crc32(0, checked.data(), checked.size()));
}

Bytes packed(const Bytes& bytes) {
  libdeflate_compressor* compressor = libdeflate_alloc_compressor(6);
  Bytes result(libdeflate_zlib_compress_bound(compressor, bytes.size()));
  result.resize(libdeflate_zlib_compress(compressor, bytes.data(), bytes.size(), result.data(),
                                         result.size()));
  libdeflate_free_compressor(compressor);
  return result;
}

/// The prediction that a filter of the PNG specification (section 9) subtracts.
int prediction(int filter, int left, int above, int above_left) {
  const int p = left + above - above_left;
  const int pa = std::abs(p - left);
  const int pb = std::abs(p - above);
  const int pc = std::abs(p - above_left);
  const int paeth = pa <= pb && pa <= pc ? left : pb <= pc ? above : above_left;
  const std::array<int, 5> values = {0, left, above, (left + above) / 2, paeth};
  return values[static_cast<std::size_t>(filter)];
}

/// Row v has filter `filters[v % size]`.
Bytes filtered(const cv::Mat& image, const std::vector<int>& filters) {
  Bytes bytes;
  const int channels = image.channels();
  for (int v = 0; v < image.rows; ++v) {
    const int filter = filters[static_cast<std::size_t>(v) % filters.size()];
    bytes.push_back(static_cast<std::uint8_t>(filter));
    for (int i = 0; i < image.cols * channels; ++i) {
      const auto at = [&](int row, int k) { return row < 0 || k < 0 ? 0 : image.ptr(row)[k]; };
      const int guess = filter > 4 ? 0
                                   : prediction(filter, at(v, i - channels), at(v - 1, i),
                                                at(v - 1, i - channels));
      bytes.push_back(static_cast<std::uint8_t>(image.ptr(v)[i] - guess));
    }
  }
  return bytes;
}

struct Png {
  int depth = 8;
  int color_type = 0;  ///< 0 gray, 2 RGB, 3 palette
  std::size_t rows = 0;
  std::size_t cols = 0;
  Bytes unpacked;
  std::vector<std::pair<std::string, Bytes>> extra;  ///< chunks before the pixels
};

Bytes encoded(const Png& png) {
  Bytes bytes = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
  Bytes header;
  add_be32(header, png.cols);
  add_be32(header, png.rows);
  for (const int value : {png.depth, png.color_type, 0, 0, 0}) {
    header.push_back(static_cast<std::uint8_t>(value));
  }
  add_chunk(bytes, "IHDR", header);
  for (const auto& [type, data] : png.extra) {
    add_chunk(bytes, type, data);
  }
  const Bytes stream = packed(png.unpacked);
  const auto middle = stream.begin() + static_cast<std::ptrdiff_t>(stream.size() / 2);
  add_chunk(bytes, "IDAT", {stream.begin(), middle});
  add_chunk(bytes, "IDAT", {middle, stream.end()});
  add_chunk(bytes, "IEND", {});
  return bytes;
}

Png png_of(const cv::Mat& image, const std::vector<int>& filters) {
  return {8,
          image.channels() == 1 ? 0 : 2,
          static_cast<std::size_t>(image.rows),
          static_cast<std::size_t>(image.cols),
          filtered(image, filters),
          {}};
}

/// Noise on slopes, so that every predictor of Paeth's filter is chosen somewhere.
cv::Mat test_image(int type, int rows = 37, int cols = 53) {
  cv::Mat image(rows, cols, type);
  cv::RNG random(5);
  random.fill(image, cv::RNG::UNIFORM, 0, 40);
  for (int v = 0; v < rows; ++v) {
    for (int i = 0; i < cols * image.channels(); ++i) {
      image.ptr(v)[i] = static_cast<std::uint8_t>(image.ptr(v)[i] + 5 * v + 3 * i);
    }
  }
  return image;
}

bool is_same(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() && cv::norm(a, b, cv::NORM_INF) == 0.0;
}

cv::Mat by_opencv(const Bytes& png, bool as_color) {
  cv::Mat image = cv::imdecode(png, as_color ? cv::IMREAD_COLOR : cv::IMREAD_GRAYSCALE);
  if (as_color && !image.empty()) {
    cv::cvtColor(image, image, cv::COLOR_BGR2RGB);
  }
  return image;
}

class PlainPng : public ::testing::TestWithParam<int> {};

TEST_P(PlainPng, EveryFilterGivesThePixelsBack) {
  const cv::Mat image = test_image(GetParam());
  const bool is_color = image.channels() == 3;
  for (const std::vector<int>& filters :
       {std::vector{0}, {1}, {2}, {3}, {4}, {4, 2, 3, 0, 1}, {1, 4, 3}}) {
    const Bytes png = encoded(png_of(image, filters));
    EXPECT_TRUE(is_same(decode_plain_png(png, is_color), image)) << filters.front();
    EXPECT_TRUE(is_same(by_opencv(png, is_color), image)) << "the test's own writer is wrong";
  }
  const cv::Mat thin = test_image(GetParam(), 1, 1);
  EXPECT_TRUE(is_same(decode_plain_png(encoded(png_of(thin, {4})), is_color), thin));
}

TEST_P(PlainPng, EveryDamagedByteIsNoticed) {
  const cv::Mat image = test_image(GetParam(), 5, 7);
  const Bytes png = encoded(png_of(image, {4, 1}));
  constexpr std::size_t kSignature = 8;
  constexpr std::size_t kEnd = 12;
  for (std::size_t i = kSignature; i < png.size() - kEnd; ++i) {
    for (const unsigned bit : {0x01U, 0x20U, 0x80U}) {
      Bytes damaged = png;
      damaged[i] = static_cast<std::uint8_t>(damaged[i] ^ bit);
      EXPECT_TRUE(decode_plain_png(damaged, image.channels() == 3).empty()) << i;
    }
  }
}

TEST_P(PlainPng, WrongContentsUnderRightChecksumsAreNoImage) {
  const cv::Mat image = test_image(GetParam());
  const bool is_color = image.channels() == 3;
  Png png = png_of(image, {1});
  png.unpacked.pop_back();
  EXPECT_TRUE(decode_plain_png(encoded(png), is_color).empty()) << "a byte is missing";
  png.unpacked.resize(png.unpacked.size() + 2, 0);
  EXPECT_TRUE(decode_plain_png(encoded(png), is_color).empty()) << "a byte too many";
  EXPECT_TRUE(decode_plain_png(encoded(png_of(image, {5})), is_color).empty()) << "no such filter";
  for (const std::size_t side : {std::size_t{0}, std::size_t{60000}, std::size_t{0xFFFFFFFF}}) {
    png = png_of(image, {1});
    png.rows = png.cols = side;
    EXPECT_TRUE(decode_plain_png(encoded(png), is_color).empty()) << side;
  }
}

TEST_P(PlainPng, ChunksThatMayChangePixelsAreLeftToLibpng) {
  const cv::Mat image = test_image(GetParam());
  const bool is_color = image.channels() == 3;
  Png png = png_of(image, {4});
  png.extra = {{"tEXt", {'a', 0, 'b'}}, {"pHYs", Bytes(9, 1)}};
  EXPECT_TRUE(is_same(decode_plain_png(encoded(png), is_color), image));
  png.extra = {{"tRNS", Bytes(is_color ? 6 : 2, 0)}};
  EXPECT_TRUE(decode_plain_png(encoded(png), is_color).empty());
}

/// Where libpng refuses a file, or reads it in another way.
TEST_P(PlainPng, WhatLibpngDoesNotTakeIsLeftToLibpng) {
  const cv::Mat image = test_image(GetParam(), 5, 7);
  const bool is_color = image.channels() == 3;
  const Bytes sound = encoded(png_of(image, {1}));
  ASSERT_FALSE(decode_plain_png(sound, is_color).empty());
  Bytes damaged_end = sound;
  damaged_end.back() ^= 1U;
  EXPECT_TRUE(decode_plain_png(damaged_end, is_color).empty());
  EXPECT_FALSE(decode_png(damaged_end, "a.png", is_color));
  constexpr std::size_t kEnd = 12;
  Bytes full_end(sound.begin(), sound.end() - kEnd);
  add_chunk(full_end, "IEND", {1});
  EXPECT_TRUE(decode_plain_png(full_end, is_color).empty());
  const std::string type = "IDAT";
  const auto second = std::find_end(sound.begin(), sound.end(), type.begin(), type.end()) - 4;
  Bytes parted(sound.begin(), second);
  add_chunk(parted, "tEXt", {'a', 0, 'b'});
  parted.insert(parted.end(), second, sound.end());
  EXPECT_TRUE(decode_plain_png(parted, is_color).empty()) << "pixels in two places";
}

INSTANTIATE_TEST_SUITE_P(GrayAndColor, PlainPng, ::testing::Values(CV_8UC1, CV_8UC3));

TEST(PngFile, EveryOtherKindHasThePixelsOpenCvGives) {
  const TempFolder folder;
  const cv::Mat color = test_image(CV_8UC3);
  const cv::Mat gray = test_image(CV_8UC1);
  cv::Mat deep;
  gray.convertTo(deep, CV_16U, 257.0);
  cv::Mat with_alpha;
  cv::cvtColor(color, with_alpha, cv::COLOR_BGR2BGRA);
  Png linear = png_of(color, {1});
  linear.extra = {{"gAMA", {0, 1, 134, 160}}, {"tRNS", Bytes(6, 0)}};
  Png palette{8, 3, 2, 2, {0, 0, 1, 0, 1, 0}, {{"PLTE", {255, 0, 0, 0, 255, 9}}}};
  std::vector<Bytes> files = {encoded(palette), encoded(linear)};
  for (const cv::Mat& image : {color, gray, deep, with_alpha}) {
    cv::imencode(".png", image, files.emplace_back());
  }
  for (const Bytes& png : files) {
    for (const bool as_color : {false, true}) {
      const auto file = folder.file("a.png", std::string(png.begin(), png.end()));
      const Expected<cv::Mat> image = read_image(file, as_color);
      EXPECT_TRUE(is_same(*image, by_opencv(png, as_color))) << png.size();
    }
  }
}

TEST(PngFile, WhatIsEncodedHasThePixels) {
  for (const int type : {CV_8UC1, CV_8UC3}) {
    const cv::Mat image = test_image(type);
    for (const bool is_fast : {false, true}) {
      const std::string png = encode_png(image, is_fast);
      const Expected<cv::Mat> decoded =
          decode_png({reinterpret_cast<const std::uint8_t*>(png.data()), png.size()}, "a.png",
                     type == CV_8UC3);
      EXPECT_TRUE(is_same(*decoded, image));
    }
  }
}

}  // namespace
}  // namespace stemvo::io
