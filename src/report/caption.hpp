// SPDX-License-Identifier: MIT
#pragma once

#include <string>

#include <opencv2/core.hpp>

namespace stemvo {

/// One line of text, centred in the height of `box`, `share` of the room left over before it;
/// shrinks until it fits. OpenCV's fonts know ASCII only: any other byte becomes a '?'. Returns
/// where the text ends.
int put_caption(cv::Mat& image,
                const cv::Rect& box,
                const std::string& text,
                const cv::Scalar& color,
                double share = 0.0);

}  // namespace stemvo
