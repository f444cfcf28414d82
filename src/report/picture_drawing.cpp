// SPDX-License-Identifier: MIT
#include "report/picture_drawing.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <opencv2/imgproc.hpp>

#include "stemvo/check.hpp"

namespace stemvo {

namespace {

constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;

}  // namespace

cv::Mat to_rgb(const cv::Mat& picture) {
  STEMVO_CHECK(picture.type() == CV_8UC1 || picture.type() == CV_8UC3, "8-bit gray or RGB");
  cv::Mat rgb;
  if (picture.channels() == 1) {
    cv::cvtColor(picture, rgb, cv::COLOR_GRAY2RGB);
  } else {
    rgb = picture.clone();
  }
  return rgb;
}

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

void put_caption(cv::Mat& rgb,
                 const cv::Rect& box,
                 const std::string& text,
                 const cv::Scalar& color) {
  const std::string ascii = to_ascii(text);
  if (ascii.empty() || box.width <= 0) {
    return;
  }
  double scale = cv::getFontScaleFromHeight(kFont, std::max(6, box.height * 2 / 5));
  const cv::Size natural = cv::getTextSize(ascii, kFont, scale, 1, nullptr);
  scale *= std::min(1.0, static_cast<double>(box.width) / natural.width);
  const cv::Size size = cv::getTextSize(ascii, kFont, scale, 1, nullptr);
  cv::putText(rgb, ascii, {box.x, box.y + (box.height + size.height) / 2}, kFont, scale, color, 1,
              cv::LINE_AA);
}

cv::Scalar flow_color(double share) {
  // The upper two thirds of viridis: they stand out on dark and bright gray, and no red is in them.
  static const std::array<cv::Vec3d, 5> kStops{
      {{38, 110, 190}, {33, 150, 160}, {60, 190, 110}, {160, 218, 57}, {253, 231, 37}}};
  const double position = std::clamp(share, 0.0, 1.0) * (kStops.size() - 1);
  const std::size_t below = std::min(static_cast<std::size_t>(position), kStops.size() - 2);
  const double part = position - static_cast<double>(below);
  const cv::Vec3d color = (1.0 - part) * kStops[below] + part * kStops[below + 1];
  return {color[0], color[1], color[2]};
}

cv::Mat stretch_for_the_eye(const cv::Mat& values) {
  STEMVO_CHECK(values.type() == CV_32FC1, "a float channel");
  std::vector<float> sorted;
  sorted.reserve(values.total());
  for (auto it = values.begin<float>(); it != values.end<float>(); ++it) {
    if (std::isfinite(*it)) {
      sorted.push_back(*it);
    }
  }
  cv::Mat picture = cv::Mat::zeros(values.size(), CV_8UC1);
  if (sorted.empty()) {
    return picture;
  }
  std::sort(sorted.begin(), sorted.end());
  const auto percentile = [&](double share) {
    return static_cast<double>(
        sorted[static_cast<std::size_t>(share * static_cast<double>(sorted.size() - 1))]);
  };
  const double low = percentile(0.005);
  const double high = percentile(0.995);
  const double gain = high > low ? 255.0 / (high - low) : 0.0;
  std::transform(values.begin<float>(), values.end<float>(), picture.begin<uchar>(), [&](float v) {
    const double gray = (static_cast<double>(v) - low) * gain;
    return std::isfinite(gray) ? cv::saturate_cast<uchar>(gray) : uchar{0};
  });
  return picture;
}

}  // namespace stemvo
