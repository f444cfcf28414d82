// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include <opencv2/core.hpp>

#include "stemvo/error.hpp"

namespace stemvo::io {

using Bytes = std::span<const std::uint8_t>;

/// The one size that an image may have; none: any, up to more pixels than a camera has.
using WantedSize = std::optional<cv::Size>;

/// The PNG, which is_png(), as 8-bit image without transparency: gray (CV_8UC1), or RGB (CV_8UC3)
/// if `as_color`. Errors, starting with `name`: of another size; cut off or damaged. An image is
/// never partly decoded. `keeps_16_bits`: one of 16 bits a value stays so (CV_16UC1, CV_16UC3).
[[nodiscard]] Expected<cv::Mat> decode_png(Bytes bytes,
                                           const std::string& name,
                                           bool as_color,
                                           const WantedSize& wanted = {},
                                           bool keeps_16_bits = false);

/// 8-bit image, gray or RGB -> the bytes of a PNG file. `is_fast`: larger, sooner. Throws
/// std::bad_alloc.
[[nodiscard]] std::string encode_png(const cv::Mat& image, bool is_fast = false);

/// Error, starting with `name`: another size than is wanted. Called before memory is asked for.
[[nodiscard]] Status check_size(const std::string& name,
                                const cv::Size2l& found,
                                const WantedSize& wanted);

[[nodiscard]] bool is_png(Bytes bytes);
/// Whether a PNG has colours; palettes are colour.
[[nodiscard]] bool is_color_png(Bytes bytes);
[[nodiscard]] bool is_16_bit_png(Bytes bytes);

}  // namespace stemvo::io
