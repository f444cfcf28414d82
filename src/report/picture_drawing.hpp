// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <string_view>

#include <opencv2/core.hpp>

namespace stemvo {

/// A copy as CV_8UC3, RGB, from gray or RGB.
[[nodiscard]] cv::Mat to_rgb(const cv::Mat& picture);

/// OpenCV's fonts know ASCII only: any other character becomes one '?'.
[[nodiscard]] std::string to_ascii(std::string_view text);

/// One line in a band of that colour under the baseline; shrinks until it fits into `box`.
void put_caption(cv::Mat& rgb,
                 const cv::Rect& box,
                 const std::string& text,
                 const cv::Scalar& color);

/// Colour of a flow of `share` (0..1) of the longest: blue over green to yellow, growing brighter.
[[nodiscard]] cv::Scalar flow_color(double share);

/// 8-bit picture of a CV_32FC1 channel between its percentiles 0.5 and 99.5; values that are not
/// finite are black.
[[nodiscard]] cv::Mat stretch_for_the_eye(const cv::Mat& values);

}  // namespace stemvo
