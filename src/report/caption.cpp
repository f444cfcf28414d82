// SPDX-License-Identifier: MIT
#include "report/caption.hpp"

#include <algorithm>

#include <opencv2/imgproc.hpp>

namespace stemvo {

int put_caption(cv::Mat& image,
                const cv::Rect& box,
                const std::string& text,
                const cv::Scalar& color,
                double share) {
  constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;
  if (text.empty() || box.width <= 0) {
    return box.x;
  }
  double scale = cv::getFontScaleFromHeight(kFont, std::max(6, box.height * 2 / 5));
  const cv::Size natural = cv::getTextSize(text, kFont, scale, 1, nullptr);
  scale *= std::min(1.0, static_cast<double>(box.width) / natural.width);
  const cv::Size size = cv::getTextSize(text, kFont, scale, 1, nullptr);
  const int x = box.x + cvRound(share * (box.width - size.width));
  cv::putText(image, text, {x, box.y + (box.height + size.height) / 2}, kFont, scale, color, 1,
              cv::LINE_AA);
  return x + size.width;
}

}  // namespace stemvo
