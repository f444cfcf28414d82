// SPDX-License-Identifier: MIT
#pragma once

#include "dataset/undistortion.hpp"
#include "stemvo/dataset/frame_source.hpp"

namespace stemvo::dataset {

/// Pictures of a folder beside a camera file (open_source).
class PictureFolder final : public FrameSource {
 public:
  /// `request.camera_file` is given.
  [[nodiscard]] static Expected<PictureFolder> open(const FrameSourceRequest& request);

  [[nodiscard]] Expected<cv::Mat> read(std::size_t index) const override;

 private:
  PictureFolder(FrameList frames, Undistortion undistortion, bool is_color)
      : FrameSource(std::move(frames)),
        undistortion_(std::move(undistortion)),
        is_color_(is_color) {}

  Undistortion undistortion_;
  bool is_color_ = false;
};

}  // namespace stemvo::dataset
