// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "stemvo/camera.hpp"
#include "stemvo/error.hpp"

namespace stemvo {

/// A printed pattern of known size.
struct Board {
  enum class Kind { kChessboard, kCharuco, kAprilGrid };
  Kind kind = Kind::kChessboard;
  cv::Size cells;          ///< inner corners; squares; tags
  double cell_m = 0.0;     ///< side of a square; of a tag
  double other_m = 0.0;    ///< charuco: side of a marker; aprilgrid: gap between tags
  std::string dictionary;  ///< OpenCV's name, such as DICT_5X5_100
};

/// "9x6:0.025": a chessboard of 9x6 inner corners, squares of 25 mm.
/// "charuco:7x5:0.04:0.03:DICT_5X5_100": 7x5 squares, their side, that of the markers.
/// "aprilgrid:6x6:0.088:0.0264[:DICT_APRILTAG_36h11]": 6x6 tags, their side, the gap between them.
/// Error: another form, a number that cannot be.
[[nodiscard]] Expected<Board> parse_board(const std::string& text);

/// Corners of a board: where they are on it (m, z = 0), and in the image (px).
struct BoardPoints {
  std::vector<cv::Point3f> on_board;
  std::vector<cv::Point2f> in_image;
};
/// Finds the board in a gray image (CV_8UC1), of markers as many as are seen; empty: it is not
/// there. ChArUco boards are of OpenCV 4.6's layout or the older one, grids of tags begin at the
/// upper left (OpenCV) or lower left (Kalibr): what fits. Error: no module or no dictionary.
[[nodiscard]] Expected<BoardPoints> find_board(const Board& board, const cv::Mat& gray);

struct BoardView {
  std::string name;
  BoardPoints points;
  cv::Vec3d camera_from_board_r = {};  ///< Rodrigues
  cv::Vec3d camera_from_board_t = {};  ///< m
  double error_px = 0.0;               ///< root mean square, per corner
  bool is_used = true;                 ///< else its error was too large beside the others'
};

struct FittedNumber {
  std::string name;
  double value = 0.0;
  double sigma = 0.0;
};

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

/// Names what pictures to take next, a line each: parts of the image without corners, tilts and
/// distances that lack. Empty: the views suffice. `views` have their poses.
[[nodiscard]] std::vector<std::string> missing_views(const std::vector<BoardView>& views,
                                                     const cv::Size& size);

/// Corners on the image's area, those of views left out hollow; parts without corners are red.
/// CV_8UC3, RGB.
[[nodiscard]] cv::Mat draw_coverage(const std::vector<BoardView>& views, const cv::Size& size);

}  // namespace stemvo
