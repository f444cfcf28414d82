// SPDX-License-Identifier: MIT
#pragma once

#include <string>

#include <opencv2/core.hpp>

#include "dataset/frame_source.hpp"
#include "dataset/video_decoder.hpp"
#include "evaluation/trajectory.hpp"
#include "pipeline/run.hpp"
#include "stemvo/error.hpp"

namespace stemvo::pipeline {

/// The video of a run: each frame with its tracks, and beside it the path so far.
class DriveVideo {
 public:
  /// Writes RunRequest::video; without it nothing. Errors: those of dataset::encode_file.
  [[nodiscard]] static Expected<DriveVideo> create(const RunRequest& request,
                                                   const FrameSource& sequence);

  [[nodiscard]] bool is_on() const { return write_ != nullptr; }
  /// `image`: RGB, of the frames' size under a caption. `unit`: of the path's lengths.
  void add(const cv::Mat& image, const Trajectory& path, const std::string& unit) const;
  /// Behind the last frame. Error: the file is not whole.
  [[nodiscard]] Status finish() const;

 private:
  std::string file_;
  cv::Size size_;
  dataset::WriteFrame write_;
};

}  // namespace stemvo::pipeline
