// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <vector>

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

/// A lens whose image is as large as frames are worked on: of more than 1.5 megapixels, sides and
/// camera divided by 1.5, 2, 2.5, .. until 1.1 are left; 4K becomes 1280x720.
[[nodiscard]] Lens working_lens(Lens lens);

/// Makes a pinhole camera's image of the working size of each frame of a lens. Size and principal
/// point stay those of the working lens; both focal lengths are scaled alike, to the widest view
/// all of whose pixels come from inside the lens' image: black edges would give corners that stand
/// still on the screen, and unequal scales would stretch the image. The view is not widened by more
/// than 1 / 0.8, which keeps resolution in the middle; beyond that a wide lens loses its rim.
/// Without distortion only the size changes.
class FrameView {
 public:
  /// Error, naming the camera file: coefficients under which no such view of half the width is
  /// left.
  [[nodiscard]] static Expected<FrameView> create(const Lens& lens,
                                                  const std::filesystem::path& camera_file);

  /// The camera of the frames that apply() makes.
  [[nodiscard]] const Camera& camera() const { return camera_; }
  /// The size of the frames as they come.
  [[nodiscard]] cv::Size full_size() const { return full_size_; }
  /// Makes the view of a frame of full_size(); several threads may call it.
  [[nodiscard]] cv::Mat apply(const cv::Mat& image) const;
  /// The mask as the frames are: 255 where all of a pixel may be used, else 0.
  [[nodiscard]] cv::Mat apply_to_mask(const cv::Mat& mask) const;

 private:
  cv::Size full_size_;
  Camera camera_;
  cv::Mat map_;           ///< whole pixels, CV_16SC2; empty: without distortion
  cv::Mat map_fraction_;  ///< CV_16UC1, as cv::convertMaps makes it
};

/// Parts of the frames, in their pixels as they come, where no points are wanted: rectangles
/// `X,Y,WIDTH,HEIGHT`, which may reach over the rim, and image files of the frames' size, black
/// (below 128) where none. Returns CV_8UC1, 0 there and 255 elsewhere; nothing asked for: an empty
/// image. Errors: neither of both; a rectangle that is empty or outside; a file of another size;
/// nothing left.
[[nodiscard]] Expected<cv::Mat> make_mask(const std::vector<std::string>& parts, cv::Size size);

}  // namespace stemvo::dataset
