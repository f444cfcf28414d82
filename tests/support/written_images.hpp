// SPDX-License-Identifier: MIT
#pragma once

#include "dataset/frame_files.hpp"
#include "support/test.hpp"

/// A folder of small images with names as told.
namespace stemvo {

class WrittenImages : public ::testing::Test {
 protected:
  /// The request of a folder that holds these images alone, 32x24 pixels, at 10 Hz.
  FrameSourceRequest write_images(
      const std::vector<std::string>& names,
      const cv::Mat& image = cv::Mat(24, 32, CV_8UC1, cv::Scalar(90))) const {
    FrameSourceRequest request;
    request.sequence_dir = temp_ / "drive";
    fs::remove_all(request.sequence_dir);
    fs::create_directories(request.sequence_dir);
    for (const std::string& name : names) {
      cv::imwrite((request.sequence_dir / name).string(), image);
    }
    request.camera_file = write_camera("30, 31, 15.5, 11.5");
    return request;
  }
  fs::path write_camera(const std::string& intrinsics) const {
    return temp_.file("camera.yaml", "resolution: [32, 24]\nintrinsics: [" + intrinsics +
                                         "]\ndistortion_model: none\nrate_hz: 10\n");
  }
  TempFolder temp_;
};

}  // namespace stemvo
