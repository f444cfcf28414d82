// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <optional>

#include <fmt/format.h>

#include "dataset/frame_view.hpp"
#include "io/image_file.hpp"
#include "text/text_file.hpp"

namespace stemvo::dataset {
namespace {

constexpr int kBlack = 128;

/// `X,Y,WIDTH,HEIGHT`; nullopt: no four whole numbers.
std::optional<cv::Rect> parse_rectangle(const std::string& part) {
  constexpr std::size_t kMax = 1000000;  // of pixels; sums of two stay inside an int
  std::string spaced = part;
  std::replace(spaced.begin(), spaced.end(), ',', ' ');
  const auto words = split_words(spaced);
  std::array<int, 4> numbers = {};
  if (words.size() != numbers.size() || std::count(part.begin(), part.end(), ',') != 3) {
    return std::nullopt;
  }
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const auto number = parse_index(words[i]);
    if (!number || *number > kMax) {
      return std::nullopt;
    }
    numbers.at(i) = static_cast<int>(*number);
  }
  return cv::Rect(numbers[0], numbers[1], numbers[2], numbers[3]);
}

Status add_part(const std::string& part, cv::Mat& mask) {
  if (const auto rectangle = parse_rectangle(part)) {
    const cv::Rect inside = *rectangle & cv::Rect({}, mask.size());
    if (inside.empty()) {
      return fail(fmt::format("--mask {}: expected a rectangle inside frames of {}x{} pixels", part,
                              mask.cols, mask.rows));
    }
    mask(inside).setTo(0);
    return {};
  }
  if (part.find_first_not_of("0123456789.,- ") == std::string::npos) {
    return fail(
        fmt::format("--mask {}: expected X,Y,WIDTH,HEIGHT in whole pixels of the frames, as "
                    "0,300,1241,76, or an image",
                    part));
  }
  const auto image = io::read_image(part, false);
  if (!image) {
    return fail(
        fmt::format("--mask: expected X,Y,WIDTH,HEIGHT in whole pixels or an image, found {}",
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
    if (const Status status = add_part(part, mask); !status) {
      return status.error();
    }
  }
  if (cv::countNonZero(mask) == 0) {
    return fail("--mask: expected a part of the frames that is left, found none");
  }
  return mask;
}

}  // namespace stemvo::dataset
