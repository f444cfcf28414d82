// SPDX-License-Identifier: MIT
#pragma once

#include "features/patch_alignment.hpp"
#include "support/test.hpp"

/// Images of a texture that is known everywhere, seen through known warps.
namespace stemvo::test {

/// Gray value of a sum of waves, which can be asked for anywhere; 128 +- 100.
inline double texture(double x, double y) {
  double sum = 0.0;
  for (int i = 1; i <= 12; ++i) {
    const double length = 5.0 + 1.5 * i;
    const double angle = 2.4 * i;
    sum += std::sin((std::cos(angle) * x + std::sin(angle) * y) * 6.28 / length + i);
  }
  return 128.0 + 100.0 * std::clamp(sum / 7.0, -1.0, 1.0);
}

/// Levels of half the size, as a front end makes them.
struct TestPyramid {
  explicit TestPyramid(cv::Mat level) {
    for (int i = 0; i < 3; ++i) {
      cv::Mat bordered;
      const int border = kPatchBorder_px;
      cv::copyMakeBorder(level, bordered, border, border, border, border, cv::BORDER_REFLECT_101);
      mats.push_back(bordered);
      levels.push_back({bordered.ptr(border) + border, static_cast<std::ptrdiff_t>(bordered.step),
                        level.cols, level.rows});
      cv::Mat half;
      cv::pyrDown(level, half);
      level = half;
    }
  }
  std::vector<cv::Mat> mats;
  std::vector<BorderedImage> levels;
};

inline constexpr int kViewWidth = 320;
inline constexpr int kViewHeight = 240;

/// The texture seen through a similarity: pixel q = t + [a -b; b a] p shows the texture at p. With
/// gain, bias, noise and blur.
struct View {
  Similarity warp;
  double gain = 1.0;
  double bias = 0.0;
  double noise = 0.0;
  double blur_px = 0.0;

  [[nodiscard]] cv::Mat render() const {
    cv::Mat values(kViewHeight, kViewWidth, CV_64F);
    const double scale_sq = warp.a * warp.a + warp.b * warp.b;
    for (int y = 0; y < kViewHeight; ++y) {
      for (int x = 0; x < kViewWidth; ++x) {
        const double dx = x - static_cast<double>(warp.x);
        const double dy = y - static_cast<double>(warp.y);
        values.at<double>(y, x) = bias + gain * texture((warp.a * dx + warp.b * dy) / scale_sq,
                                                        (-warp.b * dx + warp.a * dy) / scale_sq);
      }
    }
    if (blur_px > 0.0) {
      cv::GaussianBlur(values, values, {}, blur_px);
    }
    cv::Mat random(values.size(), CV_64F);
    cv::RNG generator(3);
    generator.fill(random, cv::RNG::NORMAL, 0.0, noise);
    cv::Mat pixels;
    cv::Mat(values + random).convertTo(pixels, CV_8U);
    return pixels;
  }
};

}  // namespace stemvo::test
