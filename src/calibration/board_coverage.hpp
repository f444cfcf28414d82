// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "calibration/board_fit.hpp"

namespace stemvo {

/// Names what pictures to take next, a line each: parts of the image without corners, tilts and
/// distances that lack. Empty: the views suffice. `views` have their poses.
[[nodiscard]] std::vector<std::string> missing_views(const std::vector<BoardView>& views,
                                                     const cv::Size& size);

/// Corners on the image's area, those of views left out hollow; parts without corners are red.
/// CV_8UC3, RGB.
[[nodiscard]] cv::Mat draw_coverage(const std::vector<BoardView>& views, const cv::Size& size);

}  // namespace stemvo
