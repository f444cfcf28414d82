// SPDX-License-Identifier: MIT
#pragma once

#include <opencv2/core.hpp>

#include "stemvo/camera.hpp"
#include "stemvo/error.hpp"

namespace stemvo {

/// Makes a camera's images what the odometry works on: without distortion (undistorted_camera) and
/// of the working size (working_camera). Without distortion only the size changes.
class FrameView {
 public:
  /// Error: that of undistorted_camera.
  [[nodiscard]] static Expected<FrameView> create(const Camera& camera);

  /// The camera of the frames that apply() makes.
  [[nodiscard]] const Camera& camera() const { return camera_; }
  /// The size of the frames as they come.
  [[nodiscard]] cv::Size full_size() const { return full_size_; }
  /// Makes the view of a frame of full_size(), the frame itself where nothing changes; several
  /// threads may call it.
  [[nodiscard]] cv::Mat apply(const cv::Mat& image) const;
  /// The mask as the frames are: 255 where all of a pixel may be used, else 0.
  [[nodiscard]] cv::Mat apply_to_mask(const cv::Mat& mask) const {
    return mask.empty() ? mask : cv::Mat(apply(mask != 0) == 255);
  }

 private:
  cv::Size full_size_;
  Camera camera_;
  cv::Mat map_;           ///< whole pixels, CV_16SC2; empty: without distortion
  cv::Mat map_fraction_;  ///< CV_16UC1, as cv::convertMaps makes it
};

}  // namespace stemvo
