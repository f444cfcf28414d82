// SPDX-License-Identifier: MIT
#pragma once

#include <array>

#include <opencv2/core.hpp>

#include "stemvo/camera.hpp"
#include "stemvo/error.hpp"

namespace stemvo::dataset {

enum class Distortion {
  kNone,
  kRadialTangential,  ///< OpenCV's k1 k2 p1 p2 k3
  kEquidistant,       ///< OpenCV's fisheye k1 k2 k3 k4
};

/// A camera as it comes out of the box.
struct Lens {
  Camera camera;
  Distortion distortion = Distortion::kNone;
  std::array<double, 5> coefficients = {};  ///< those a model does not have are 0
};

/// Where the lens shows what a pinhole camera of focal length 1 sees at `xy`: both on the plane
/// z = 1. OpenCV's formulas.
[[nodiscard]] Eigen::Vector2d distort(const Lens& lens, const Eigen::Vector2d& xy);

/// Makes a pinhole camera's images of a lens' images. Size and principal point stay; both focal
/// lengths are scaled alike, to the widest view all of whose pixels come from inside the lens'
/// image: black edges would give corners that stand still on the screen, and unequal scales
/// would stretch the image. The view is not widened by more than 1 / 0.8, which keeps resolution
/// in the middle; beyond that a wide lens loses its rim. Without distortion nothing changes.
class Undistortion {
 public:
  /// Error, without a file: coefficients under which no such view of half the width is left.
  [[nodiscard]] static Expected<Undistortion> create(const Lens& lens);

  [[nodiscard]] const Camera& camera() const { return camera_; }
  /// An image of the lens' size; several threads may call it.
  [[nodiscard]] cv::Mat apply(const cv::Mat& image) const;

 private:
  Camera camera_;
  cv::Mat map_;           ///< whole pixels, CV_16SC2; empty: nothing to do
  cv::Mat map_fraction_;  ///< CV_16UC1, as cv::convertMaps makes it
};

}  // namespace stemvo::dataset
