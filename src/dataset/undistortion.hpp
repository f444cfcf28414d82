// SPDX-License-Identifier: MIT
#pragma once

#include <opencv2/core.hpp>

#include "dataset/lens.hpp"
#include "stemvo/error.hpp"
#include "stemvo/geometry/camera.hpp"

namespace stemvo::dataset {

/// Makes a pinhole camera's pictures of a lens' pictures. Size and principal point stay; both focal
/// lengths are scaled alike, to the widest view all of whose pixels come from inside the lens'
/// picture: black edges would give corners that stand still on the screen, and unequal scales
/// would stretch the picture. The view is not widened by more than 1 / 0.8, which keeps resolution
/// in the middle; beyond that a wide lens loses its rim. Without distortion nothing changes.
class Undistortion {
 public:
  /// Error, without a file: coefficients under which no such view of half the width is left.
  [[nodiscard]] static Expected<Undistortion> create(const Lens& lens);

  [[nodiscard]] const Camera& camera() const { return camera_; }
  /// A picture of the lens' size; several threads may call it.
  [[nodiscard]] cv::Mat apply(const cv::Mat& picture) const;

 private:
  Camera camera_;
  cv::Mat map_;           ///< whole pixels, CV_16SC2; empty: nothing to do
  cv::Mat map_fraction_;  ///< CV_16UC1, as cv::convertMaps makes it
};

}  // namespace stemvo::dataset
