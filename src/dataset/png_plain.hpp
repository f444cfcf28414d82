// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <span>

#include <opencv2/core.hpp>

namespace stemvo::dataset {

/// The common kind of PNG, which is what KITTI has, by libdeflate: in a third of the time that
/// libpng and zlib take. `bytes` is a complete file (all chunks to IEND lie inside it). Empty:
/// it is of another kind (other than 8-bit gray, or RGB with `as_color`; interlaced; with chunks
/// that may change pixels), or something in it is wrong (checksums are compared). RGB order.
[[nodiscard]] cv::Mat decode_plain_png(std::span<const std::uint8_t> bytes, bool as_color);

}  // namespace stemvo::dataset
