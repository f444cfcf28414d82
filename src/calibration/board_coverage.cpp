// SPDX-License-Identifier: MIT
#include "calibration/board_coverage.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "report/frame_image.hpp"

namespace stemvo {
namespace {

constexpr int kColumns = 9;  ///< of cells; three to a part of the image
constexpr int kRows = 6;     ///< two to a part

using Cells = std::array<std::array<bool, kColumns>, kRows>;

/// Cells with corners.
Cells covered_cells(const std::vector<BoardView>& views, const cv::Size& size) {
  Cells cells = {};
  for (const BoardView& view : views) {
    for (const cv::Point2f& corner : view.points.in_image) {
      const int x = std::clamp(static_cast<int>(corner.x * kColumns / size.width), 0, kColumns - 1);
      const int y = std::clamp(static_cast<int>(corner.y * kRows / size.height), 0, kRows - 1);
      cells[static_cast<std::size_t>(y)][static_cast<std::size_t>(x)] |= view.is_used;
    }
  }
  return cells;
}

/// Parts of the image, of nine, less than half of which have corners.
std::vector<std::string> empty_parts(const Cells& cells) {
  constexpr const char* kAcross[] = {"left", "middle", "right"};
  constexpr const char* kDown[] = {"upper", "middle", "lower"};
  std::vector<std::string> parts;
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 3; ++column) {
      int count = 0;
      for (std::size_t i = 0; i < 6; ++i) {
        count += cells[2 * row + i / 3][3 * column + i % 3] ? 1 : 0;
      }
      if (count < 3) {
        parts.push_back(
            row == 1 && column == 1 ? "middle" : fmt::format("{} {}", kDown[row], kAcross[column]));
      }
    }
  }
  return parts;
}

/// Bounds of what the views show the board as.
struct Spread {
  double right = 0.0;  ///< most tilt with the right side nearer: sine
  double left = 0.0;
  double lower = 0.0;
  double upper = 0.0;
  double largest = 0.0;  ///< share of the image's width or height that the board takes
  double nearest_m = std::numeric_limits<double>::infinity();
  double farthest_m = 0.0;
};

Spread spread_of(const std::vector<BoardView>& views, const cv::Size& size) {
  Spread spread;
  for (const BoardView& view : views) {
    if (!view.is_used) {
      continue;
    }
    cv::Matx33d rotation;
    cv::Rodrigues(view.camera_from_board_r, rotation);
    const double sign = rotation(2, 2) < 0.0 ? -1.0 : 1.0;
    const double x = sign * rotation(0, 2);  // the board's normal, away from the camera
    const double y = sign * rotation(1, 2);
    spread.right = std::max(spread.right, x);
    spread.left = std::max(spread.left, -x);
    spread.lower = std::max(spread.lower, y);
    spread.upper = std::max(spread.upper, -y);
    const cv::Rect2f box = cv::boundingRect(view.points.in_image);
    spread.largest = std::max(
        {spread.largest, double{box.width} / size.width, double{box.height} / size.height});
    spread.nearest_m = std::min(spread.nearest_m, view.camera_from_board_t[2]);
    spread.farthest_m = std::max(spread.farthest_m, view.camera_from_board_t[2]);
  }
  return spread;
}

}  // namespace

std::vector<std::string> missing_views(const std::vector<BoardView>& views, const cv::Size& size) {
  constexpr std::ptrdiff_t kEnoughViews = 12;
  constexpr double kMinTilt = 0.3;  // sine: 17 degrees
  constexpr double kMinShare = 0.5;
  constexpr double kMinRatio = 1.4;
  std::vector<std::string> missing;
  const std::vector<std::string> parts = empty_parts(covered_cells(views, size));
  if (!parts.empty()) {
    missing.push_back(fmt::format("the board in the {} of the image", fmt::join(parts, ", ")));
  }
  const Spread spread = spread_of(views, size);
  for (const auto& [tilt, side] :
       {std::pair(spread.left, "left"), std::pair(spread.right, "right"),
        std::pair(spread.upper, "upper"), std::pair(spread.lower, "lower")}) {
    if (tilt < kMinTilt) {
      missing.push_back(fmt::format("its {} side nearer, tilted by 20 to 45 degrees", side));
    }
  }
  if (spread.largest < kMinShare) {
    missing.emplace_back("from nearer, so that it fills half of the image");
  }
  if (spread.farthest_m < kMinRatio * spread.nearest_m) {
    missing.emplace_back("from farther away, half again as far as the nearest");
  }
  const auto num_used = std::ranges::count_if(views, &BoardView::is_used);
  if (num_used < kEnoughViews) {
    missing.push_back(fmt::format("{} views more", kEnoughViews - num_used));
  }
  return missing;
}

cv::Mat draw_coverage(const std::vector<BoardView>& views, const cv::Size& size) {
  constexpr double kWidth_px = 960.0;
  const double scale = kWidth_px / size.width;
  cv::Mat image(cvRound(scale * size.height), cvRound(kWidth_px), CV_8UC3, cv::Scalar::all(255));
  const Cells cells = covered_cells(views, size);
  for (int row = 0; row < kRows; ++row) {
    for (int column = 0; column < kColumns; ++column) {
      const cv::Point from(image.cols * column / kColumns, image.rows * row / kRows);
      const cv::Point to(image.cols * (column + 1) / kColumns, image.rows * (row + 1) / kRows);
      if (!cells[static_cast<std::size_t>(row)][static_cast<std::size_t>(column)]) {
        cv::rectangle(image, from, to, cv::Scalar(250, 205, 200), cv::FILLED);
      }
      cv::rectangle(image, from, to, cv::Scalar::all(225));
    }
  }
  for (const BoardView& view : views) {
    for (const cv::Point2f& corner : view.points.in_image) {
      cv::circle(image, cv::Point2d(corner) * scale, 3,
                 view.is_used ? cv::Scalar(20, 90, 150) : cv::Scalar::all(150),
                 view.is_used ? cv::FILLED : 1, cv::LINE_AA);
    }
  }
  return draw_under_caption(image, "corners; hollow: of views left out", "red: no corners yet");
}

}  // namespace stemvo
