// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "calibration/board.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/error.hpp"

namespace stemvo {

/// A picture of the board.
struct BoardView {
  std::string name;
  BoardPoints points;
  cv::Vec3d camera_from_board_r = {};  ///< Rodrigues
  cv::Vec3d camera_from_board_t = {};  ///< m
  double error_px = 0.0;               ///< root mean square, per corner
  bool is_used = true;                 ///< else its error was too large beside the others'
};

/// One number of the camera with its standard deviation.
struct FittedNumber {
  std::string name;
  double value = 0.0;
  double sigma = 0.0;
};

/// The camera that views of a board tell.
struct BoardFit {
  Camera camera;
  std::vector<FittedNumber> numbers;  ///< fx, fy, cx, cy, k1, k2, p1, p2, k3
  double error_px = 0.0;              ///< root mean square, per corner, of the views used
};

/// OpenCV's calibration, radial-tangential, with k3 where that is more than three sigmas. A view
/// whose error is over three times the median's and over a quarter of a pixel is left out, the
/// worst first. Sets the views' poses and errors. Errors: under three views; views that tell no
/// camera.
[[nodiscard]] Expected<BoardFit> fit_camera(std::vector<BoardView>& views, const cv::Size& size);

}  // namespace stemvo
