// SPDX-License-Identifier: MIT
#include "report/caption.hpp"

#include <algorithm>
#include <string>

#include <opencv2/imgproc.hpp>

namespace stemvo {
namespace {

constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;

std::string to_ascii(std::string_view text) {
  std::string result;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if ((byte & 0xC0) != 0x80) {  // not the rest of a character
      result += byte >= 0x20 && byte < 0x7F ? c : '?';
    }
  }
  return result;
}

}  // namespace

int put_caption(cv::Mat& image,
                const cv::Rect& box,
                std::string_view text,
                const cv::Scalar& color,
                double share) {
  const std::string ascii = to_ascii(text);
  if (ascii.empty() || box.width <= 0) {
    return box.x;
  }
  double scale = cv::getFontScaleFromHeight(kFont, std::max(6, box.height * 2 / 5));
  const cv::Size natural = cv::getTextSize(ascii, kFont, scale, 1, nullptr);
  scale *= std::min(1.0, static_cast<double>(box.width) / natural.width);
  const cv::Size size = cv::getTextSize(ascii, kFont, scale, 1, nullptr);
  const int x = box.x + cvRound(share * (box.width - size.width));
  cv::putText(image, ascii, {x, box.y + (box.height + size.height) / 2}, kFont, scale, color, 1,
              cv::LINE_AA);
  return x + size.width;
}

}  // namespace stemvo
