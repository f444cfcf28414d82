// SPDX-License-Identifier: MIT
#include <algorithm>
#include <optional>

#include <fmt/format.h>

#include "dataset/frame_files.hpp"
#include "io/image_file.hpp"
#include "text/text_file.hpp"
#include "try.hpp"

namespace stemvo::dataset {
namespace {

constexpr int kBlack = 128;

/// `X,Y,WIDTH,HEIGHT`; nullopt: no four numbers.
std::optional<cv::Rect2d> parse_rectangle(std::string part) {
  std::ranges::replace(part, ',', ' ');
  const auto numbers = parse_numbers(part, 4);
  return numbers
             ? std::optional(cv::Rect2d((*numbers)[0], (*numbers)[1], (*numbers)[2], (*numbers)[3]))
             : std::nullopt;
}

Status add_part(const std::string& part, cv::Mat& mask) {
  if (const auto rectangle = parse_rectangle(part)) {
    const cv::Rect inside = *rectangle & cv::Rect2d(0, 0, mask.cols, mask.rows);
    if (inside.empty()) {
      return fail(fmt::format("--mask {}: expected a rectangle inside frames of {}x{} pixels", part,
                              mask.cols, mask.rows));
    }
    mask(inside).setTo(0);
    return {};
  }
  const auto image = io::read_image(part, false);
  if (!image) {
    return fail(
        fmt::format("--mask: expected X,Y,WIDTH,HEIGHT in pixels of the frames, as "
                    "0,300,1241,76, or an image, found {}",
                    image.error().message));
  }
  if (image->size() != mask.size()) {
    return fail(fmt::format("{}: expected a mask of {}x{} pixels, as the frames, found {}x{}", part,
                            mask.cols, mask.rows, image->cols, image->rows));
  }
  mask.setTo(0, *image < kBlack);
  return {};
}

}  // namespace

Expected<cv::Mat> make_mask(const std::vector<std::string>& parts, cv::Size size) {
  if (parts.empty()) {
    return cv::Mat();
  }
  cv::Mat mask(size, CV_8UC1, cv::Scalar(255));
  for (const std::string& part : parts) {
    STEMVO_TRY(add_part(part, mask));
  }
  if (cv::countNonZero(mask) == 0) {
    return fail("--mask: expected a part of the frames that is left, found none");
  }
  return mask;
}

}  // namespace stemvo::dataset
