// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <span>

#include <opencv2/core.hpp>

namespace stemvo::dataset {

/// Undoes the filters of a PNG that is not interlaced (specification, section 9): `filtered` holds
/// per row of `image`, CV_8UC1 or CV_8UC3, one byte that names the filter, then the row; its size
/// is checked. False: a row names a filter that does not exist.
[[nodiscard]] bool undo_png_filters(std::span<const std::uint8_t> filtered, cv::Mat& image);

}  // namespace stemvo::dataset
