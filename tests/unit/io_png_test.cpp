// SPDX-License-Identifier: MIT
#include "io/png.hpp"
#include "support/test.hpp"

namespace stemvo::io {
namespace {

using File = std::vector<std::uint8_t>;

/// Noise on slopes.
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

File encoded(const cv::Mat& image, const std::vector<int>& options = {}) {
  File png;
  cv::imencode(".png", image, png, options);
  return png;
}

bool is_same(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() && cv::norm(a, b, cv::NORM_INF) == 0.0;
}

cv::Mat by_opencv(const File& png, bool as_color, int flags = 0) {
  cv::Mat image = cv::imdecode(png, flags | cv::IMREAD_COLOR);
  cv::cvtColor(image, image, as_color ? cv::COLOR_BGR2RGB : cv::COLOR_BGR2GRAY);
  return image;
}

TEST(Png, EveryKindHasThePixelsOpenCvGives) {
  const cv::Mat color = test_image(CV_8UC3);
  const cv::Mat gray = test_image(CV_8UC1);
  cv::Mat deep;
  cv::Mat deep_color;
  cv::Mat with_alpha;
  gray.convertTo(deep, CV_16U, 257.0);
  color.convertTo(deep_color, CV_16U, 257.0);
  cv::cvtColor(color, with_alpha, cv::COLOR_BGR2BGRA);
  std::vector<File> files = {encoded(gray, {cv::IMWRITE_PNG_BILEVEL, 1})};
  using namespace std::string_literals;
  for (const cv::Mat& image : {color, gray, deep, deep_color, with_alpha}) {
    files.push_back(encoded(image));
  }
  /// 2x2 pixels of a palette with red and green.
  const std::string palette =
      "\211PNG\015\012\032\012\000\000\000\015IHDR\000\000\000\002\000\000\000\002\001\003\000\000"
      "\000"
      "Hx\237g\000\000\000\006PLTE\377\000\000\000\377\011\253[W\325\000\000\000\014IDA"
      "Tx\332cp`h\000\000\001D\000\301\004\207\317\372\000\000\000\000IEND\256B`\202"s;
  /// 5x5 pixels, interlaced, one gray level of them transparent.
  const std::string interlaced =
      "\211PNG\015\012\032\012\000\000\000\015IHDR\000\000\000\005\000\000\000\005"
      "\010\000\000\000\001\337\003I\257\000\000\000\002tRNS\000\011\017Ou\234\000"
      "\000\000-IDATx\332c``Pa\330r\203A\210\341\030CTN"
      "\035\003\247\064Cr)\303\336\363\014\272f\366\036\201\014\355\023f.Z\015\000"
      "\237\267\012\215\210R\354\244\000\000\000\000IEND\256B`\202"s;
  files.emplace_back(palette.begin(), palette.end());
  files.emplace_back(interlaced.begin(), interlaced.end());
  for (const File& png : files) {
    for (const bool as_color : {false, true}) {
      const Expected<cv::Mat> image = decode_png(png, "a.png", as_color);
      EXPECT_TRUE(is_same(*image, by_opencv(png, as_color))) << png.size();
    }
  }
}

TEST(Png, SixteenBitsStayWhereAskedFor) {
  cv::Mat gray;
  cv::Mat color;
  test_image(CV_8UC1).convertTo(gray, CV_16U, 251.0, 3.0);
  test_image(CV_8UC3).convertTo(color, CV_16U, 251.0, 3.0);
  EXPECT_TRUE(is_same(*decode_png(encoded(gray), "a.png", false, {}, true), gray));
  const File png = encoded(color);
  EXPECT_TRUE(is_same(*decode_png(png, "a.png", true, {}, true),
                      by_opencv(png, true, cv::IMREAD_ANYDEPTH)));
}

TEST(Png, EveryDamagedByteIsNoticed) {
  for (const int type : {CV_8UC1, CV_8UC3}) {
    const File png = encoded(test_image(type, 5, 7));
    constexpr std::size_t kLastChecksum = 4;  // without it nothing of the image is missing
    for (std::size_t i = 0; i < png.size(); ++i) {
      for (const unsigned bit : {0x01U, 0x80U}) {
        File damaged = png;
        damaged[i] = static_cast<std::uint8_t>(damaged[i] ^ bit);
        EXPECT_FALSE(decode_png(damaged, "a.png", type == CV_8UC3)) << i;
      }
      EXPECT_EQ(decode_png({png.data(), i}, "a.png", type == CV_8UC3).has_value(),
                i >= png.size() - kLastChecksum)
          << "cut off at " << i;
    }
  }
}

TEST(Png, WhatIsEncodedHasThePixels) {
  for (const int type : {CV_8UC1, CV_8UC3}) {
    const cv::Mat image = test_image(type);
    for (const bool is_fast : {false, true}) {
      const std::string png = encode_png(image, is_fast);
      const File bytes(png.begin(), png.end());
      EXPECT_TRUE(is_same(*decode_png(bytes, "a.png", type == CV_8UC3), image));
    }
  }
}

}  // namespace
}  // namespace stemvo::io
