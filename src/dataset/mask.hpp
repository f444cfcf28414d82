// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "stemvo/error.hpp"

namespace stemvo::dataset {

/// Parts of the frames, in their pixels as they come, where no points are wanted: rectangles
/// `X,Y,WIDTH,HEIGHT`, which may reach over the rim, and image files of the frames' size, black
/// (below 128) where none. Returns CV_8UC1, 0 there and 255 elsewhere; nothing asked for: an empty
/// image. Errors: neither of both; a rectangle that is empty or outside; a file of another size;
/// nothing left.
[[nodiscard]] Expected<cv::Mat> make_mask(const std::vector<std::string>& parts, cv::Size size);

}  // namespace stemvo::dataset
