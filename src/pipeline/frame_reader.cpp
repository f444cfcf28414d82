// SPDX-License-Identifier: MIT
#include "pipeline/frame_reader.hpp"

#include "stemvo/check.hpp"

namespace stemvo::pipeline {

FrameReader::FrameReader(const KittiSequence& sequence) : sequence_(sequence) { start_reading(); }

Expected<cv::Mat> FrameReader::next() {
  STEMVO_CHECK(ahead_.valid(), "a frame for each call");
  Expected<cv::Mat> frame = ahead_.get();
  ++index_;
  start_reading();
  return frame;
}

void FrameReader::start_reading() {
  if (index_ < sequence_.size()) {
    ahead_ =
        std::async(std::launch::async, [this, index = index_] { return sequence_.read(index); });
  }
}

}  // namespace stemvo::pipeline
