// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include <opencv2/core.hpp>

#include "io/png.hpp"
#include "stemvo/error.hpp"

namespace stemvo::io {

/// What all images of a folder have in common.
struct ImageKind {
  cv::Size size;
  bool is_color = false;
  bool operator==(const ImageKind&) const = default;
};

/// A PNG or a JPEG, told by its first bytes and decoded whole. Error (file named): neither, or
/// cut off, or damaged. Of a JPEG the sensor's rows and columns: a wish to be shown turned (EXIF)
/// is ignored, since the calibration knows nothing of it.
[[nodiscard]] Expected<ImageKind> read_image_kind(const std::filesystem::path& file,
                                                  const WantedSize& wanted = {});
/// What it says its size is, by its first 64 kB. None: it cannot be told, or no image has it.
[[nodiscard]] WantedSize declared_size(const std::filesystem::path& file);
/// The same as 8-bit image: gray (CV_8UC1), or RGB (CV_8UC3) if `as_color`. A file that is too
/// large for the size it declares, or declares another than is wanted, is not read to its end.
[[nodiscard]] Expected<cv::Mat> read_image(const std::filesystem::path& file,
                                           bool as_color,
                                           const WantedSize& wanted = {});
/// The same of a file's bytes; `name` starts its errors.
[[nodiscard]] Expected<cv::Mat> decode_image(Bytes bytes,
                                             const std::string& name,
                                             bool as_color,
                                             const WantedSize& wanted = {});
/// The same where only a PNG is expected.
[[nodiscard]] Expected<cv::Mat> read_png(const std::filesystem::path& file,
                                         bool as_color,
                                         const WantedSize& wanted = {});

/// 8-bit image, gray or RGB -> the bytes of a JPEG file (baseline, colours at half the size).
/// `quality`: 1 to 100. Throws std::bad_alloc.
[[nodiscard]] std::string encode_jpeg(const cv::Mat& image, int quality);

}  // namespace stemvo::io
