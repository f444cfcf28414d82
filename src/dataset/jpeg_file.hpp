// SPDX-License-Identifier: MIT
#pragma once

#include <string>

#include <opencv2/core.hpp>

#include "dataset/file_bytes.hpp"
#include "stemvo/error.hpp"

namespace stemvo::dataset {

/// A complete JPEG as 8-bit picture: gray (CV_8UC1), or RGB (CV_8UC3) if `as_color`. The sensor's
/// rows and columns: a wish to be shown turned (EXIF) is not followed, since the calibration knows
/// nothing of it. Errors, starting with `name`: cut off; damaged. The markers are walked to the end
/// first, because the decoder fills what is missing with gray.
[[nodiscard]] Expected<cv::Mat> decode_jpeg(const Bytes& bytes,
                                            const std::string& name,
                                            bool as_color);

/// By the first bytes.
[[nodiscard]] bool is_jpeg(const Bytes& bytes);
/// Of a JPEG: more than one component.
[[nodiscard]] bool is_color_jpeg(const Bytes& bytes);

}  // namespace stemvo::dataset
