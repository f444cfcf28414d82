// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <future>

#include <opencv2/core.hpp>

#include "stemvo/dataset/sequence.hpp"
#include "stemvo/error.hpp"

namespace stemvo::pipeline {

/// Reads the frames of a sequence in order, one ahead: decoding a PNG takes as long as finding its
/// pose, and this way the two share the cores.
class FrameReader {
 public:
  explicit FrameReader(const KittiSequence& sequence);

  /// The next frame, or the Error that names its file. At most sequence.size() calls (checked).
  [[nodiscard]] Expected<cv::Mat> next();

 private:
  void start_reading();

  const KittiSequence& sequence_;
  std::size_t index_ = 0;
  std::future<Expected<cv::Mat>> ahead_;
};

}  // namespace stemvo::pipeline
