// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <vector>

#include <opencv2/core.hpp>

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

}  // namespace stemvo
