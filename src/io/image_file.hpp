// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "io/png.hpp"
#include "stemvo/error.hpp"

namespace stemvo::io {

/// Which values of 16 bits become 0 and 255; of 8 bits none change.
struct Levels {
  int low = 0;
  int high = 65535;
  bool operator==(const Levels&) const = default;
};

struct ImageKind {
  cv::Size size;
  bool is_color = false;
  std::optional<Levels> used;  ///< 16 bits: all but the darkest and brightest thousandth
  int peak = 0;                ///< 16 bits: the largest value
  int orientation = 1;         ///< a JPEG's, by EXIF: 2 to 8 are to be shown turned or mirrored
};

/// The levels that these images of 16 bits use: as many bits as the largest value has; less where
/// they use less than a quarter of these, and half of that more to both sides.
[[nodiscard]] Levels used_levels(const std::vector<ImageKind>& kinds);

/// A PNG or a JPEG, told by its first bytes, as 8-bit image: gray (CV_8UC1), or RGB (CV_8UC3) if
/// `as_color`, in the sensor's rows and columns: the calibration knows nothing of EXIF's turn.
/// Errors (file named): neither, cut off, damaged, of another size.
[[nodiscard]] Expected<cv::Mat> read_image(const std::filesystem::path& file,
                                           bool as_color,
                                           const WantedSize& wanted = {},
                                           const Levels& levels = {});
[[nodiscard]] Expected<ImageKind> read_image_kind(const std::filesystem::path& file);

/// 8-bit image, gray or RGB -> the bytes of a JPEG file (baseline, colours at half the size).
/// `quality`: 1 to 100. Throws std::bad_alloc.
[[nodiscard]] std::string encode_jpeg(const cv::Mat& image, int quality);

}  // namespace stemvo::io
