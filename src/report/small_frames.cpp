// SPDX-License-Identifier: MIT
#include "report/small_frames.hpp"

#include <fmt/format.h>

#include "report/frame_image.hpp"

namespace stemvo {

void SmallFrames::add(std::size_t row, std::size_t number, const cv::Mat& image) {
  constexpr int kWidth_px = 320;
  if (row % step_ != 0 || image.empty()) {
    return;
  }
  images_.push_back({fmt::format("frame {}", number), encode_jpeg(image, kWidth_px), row});
  num_bytes_ += images_.back().jpeg.size();
  while (num_bytes_ > max_bytes_ && images_.size() > 1) {
    step_ *= 2;
    std::erase_if(images_, [this](const auto& kept) { return kept.row % step_ != 0; });
    num_bytes_ = 0;
    for (const html::CaptionedImage& kept : images_) {
      num_bytes_ += kept.jpeg.size();
    }
  }
}

}  // namespace stemvo
