// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>

#include <opencv2/core.hpp>

#include "stemvo/error.hpp"

namespace stemvo::dataset {

/// What all pictures of a folder have in common.
struct PictureKind {
  cv::Size size;
  bool is_color = false;
  bool operator==(const PictureKind&) const = default;
};

/// A PNG or a JPEG, told by its first bytes and decoded whole. Error (file named): neither, or
/// cut off, or damaged.
[[nodiscard]] Expected<PictureKind> read_picture_kind(const std::filesystem::path& file);
/// The same as 8-bit picture: gray (CV_8UC1), or RGB (CV_8UC3) if `as_color`.
[[nodiscard]] Expected<cv::Mat> read_picture(const std::filesystem::path& file, bool as_color);

}  // namespace stemvo::dataset
