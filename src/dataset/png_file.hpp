// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <string>

#include <opencv2/core.hpp>

#include "dataset/file_bytes.hpp"
#include "stemvo/error.hpp"

namespace stemvo::dataset {

/// A complete PNG as 8-bit picture: gray (CV_8UC1), or RGB (CV_8UC3) if `as_color`. Errors, naming
/// the file: cannot be opened; not a PNG; cut off; damaged. A picture is never partly decoded: the
/// chunks are walked to the end first, because some decoders fill what is missing with gray.
[[nodiscard]] Expected<cv::Mat> read_png(const std::filesystem::path& file, bool as_color);

/// The same of a file's bytes; messages start with `name`.
[[nodiscard]] Expected<cv::Mat> decode_png(const Bytes& bytes,
                                           const std::string& name,
                                           bool as_color);

/// By the first bytes.
[[nodiscard]] bool is_png(const Bytes& bytes);
/// Of a PNG: palettes are colour.
[[nodiscard]] bool is_color_png(const Bytes& bytes);

}  // namespace stemvo::dataset
