// SPDX-License-Identifier: MIT
#include "features/patch_pyramid.hpp"

#include <cmath>
#include <cstdlib>
#include <iterator>

#include <opencv2/imgproc.hpp>

namespace stemvo {
namespace {

cv::Mat with_border(const cv::Mat& level) {
  constexpr int kBorder = kPatchBorder_px;
  cv::Mat bordered;
  cv::copyMakeBorder(level, bordered, kBorder, kBorder, kBorder, kBorder, cv::BORDER_REFLECT_101);
  return bordered(cv::Rect(kBorder, kBorder, level.cols, level.rows));
}

/// Coefficients of the cubic B-spline through the pixels (Unser, Splines: a perfect fit, 1999). The
/// filter sharpens: about the middle of their range and at less contrast 8 bits hold its values,
/// which alignment allows for.
cv::Mat spline_coefficients(const cv::Mat& pixels) {
  constexpr double kPole = -0.26794919243112270;  // sqrt(3) - 2
  constexpr int kReach = 3;                       // the pole's fourth power is 0.005
  constexpr double kMiddle = 128.0;
  cv::Mat filter(1, 2 * kReach + 1, CV_32F);
  for (int i = -kReach; i <= kReach; ++i) {
    filter.at<float>(i + kReach) = static_cast<float>(std::pow(kPole, std::abs(i)));
  }
  filter /= cv::sum(filter)[0];
  cv::Mat coefficients;
  cv::sepFilter2D(pixels, coefficients, CV_8U, filter * kSplineContrast, filter, {-1, -1},
                  (1.0 - kSplineContrast) * kMiddle, cv::BORDER_REFLECT_101);
  return coefficients;
}

}  // namespace

PatchPyramid::PatchPyramid(const ChannelImage& seen, int num_levels)
    : ImagePyramid(seen), coefficients_(with_border(spline_coefficients(seen.pixels))) {
  while (std::ssize(levels) < num_levels) {
    cv::Mat half;
    cv::pyrDown(levels.back(), half);
    levels.push_back(with_border(half));
  }
  for (const cv::Mat& level : levels) {
    const cv::Mat& aligned = bordered.empty() ? coefficients_ : level;
    bordered.push_back(
        {aligned.data, static_cast<std::ptrdiff_t>(aligned.step), aligned.cols, aligned.rows});
  }
}

}  // namespace stemvo
