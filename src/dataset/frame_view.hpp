// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "dataset/undistortion.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/error.hpp"

namespace stemvo::dataset {

/// A lens whose image is as large as frames are worked on: of more than 1.5 megapixels, sides and
/// camera divided by 1.5, 2, 2.5, .. until 1.1 are left; 4K becomes 1280x720.
[[nodiscard]] Lens working_lens(Lens lens);

/// What is made of each frame of a lens: the working size, without distortion.
class FrameView {
 public:
  /// Errors, naming the camera file: those of Undistortion::create.
  [[nodiscard]] static Expected<FrameView> create(const Lens& lens,
                                                  const std::filesystem::path& camera_file);

  /// Of what apply() makes.
  [[nodiscard]] const Camera& camera() const { return undistortion_.camera(); }
  /// Of the frames as they come.
  [[nodiscard]] cv::Size full_size() const { return full_size_; }
  /// Of a frame of full_size(); several threads may call it.
  [[nodiscard]] cv::Mat apply(const cv::Mat& image) const;
  /// The mask as the frames are: 255 where all of a pixel may be used, else 0.
  [[nodiscard]] cv::Mat apply_to_mask(const cv::Mat& mask) const;

 private:
  FrameView(cv::Size full_size, Undistortion undistortion)
      : full_size_(full_size), undistortion_(std::move(undistortion)) {}

  cv::Size full_size_;
  Undistortion undistortion_;
};

/// Parts of the frames, in their pixels as they come, where no points are wanted: rectangles
/// `x,y,w,h`, which may reach over the rim, and image files of the frames' size, black (below 128)
/// where none. Returns CV_8UC1, 0 there and 255 elsewhere; nothing asked for: an empty image.
/// Errors: neither of both; a rectangle that is empty or outside; a file of another size; nothing
/// left.
[[nodiscard]] Expected<cv::Mat> make_mask(const std::vector<std::string>& parts, cv::Size size);

}  // namespace stemvo::dataset
