// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <vector>

#include <opencv2/core.hpp>

#include "html/page.hpp"

namespace stemvo {

/// Small images of a recording for its page: every tenth frame. Where they would take more than
/// `max_bytes`, every other one goes, until they fit: a page stays one that can be sent.
class SmallFrames {
 public:
  explicit SmallFrames(std::size_t max_bytes = 3'500'000) : max_bytes_(max_bytes) {}

  /// `row`: the frame's, in frames.csv; rows rise. The image is gray or RGB; an empty one is left
  /// out. `number`: the frame's in its recording.
  void add(std::size_t row, std::size_t number, const cv::Mat& image);
  [[nodiscard]] const std::vector<html::CaptionedImage>& images() const { return images_; }

 private:
  std::size_t max_bytes_;
  std::size_t num_bytes_ = 0;
  std::size_t step_ = 10;  ///< rows from one to the next
  std::vector<html::CaptionedImage> images_;
};

}  // namespace stemvo
