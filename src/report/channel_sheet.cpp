// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>

#include <opencv2/imgproc.hpp>

#include "report/picture_drawing.hpp"
#include "stemvo/check.hpp"
#include "stemvo/report/frame_picture.hpp"

namespace stemvo {

namespace {

constexpr int kSheetWidth_px = 2000;
constexpr int kGap_px = 16;
constexpr int kLabel_px = 34;
constexpr double kSheetAspect = 1.4;  // width over height aimed at
const cv::Scalar kPaper(255, 255, 255);
const cv::Scalar kInk(34, 34, 34);

/// Columns that bring the sheet nearest to its aspect.
int count_columns(std::size_t num_cells, double cell_aspect) {
  const double columns = std::sqrt(static_cast<double>(num_cells) * kSheetAspect / cell_aspect);
  return std::clamp(static_cast<int>(std::lround(columns)), 1, static_cast<int>(num_cells));
}

cv::Mat picture_of(const cv::Mat& channel) {
  return to_rgb(channel.type() == CV_32FC1 ? stretch_for_the_eye(channel) : channel);
}

/// Smaller by averaging; larger by repeating, so that a coarse channel shows its own pixels.
cv::Mat fit(const cv::Mat& picture, const cv::Size& size) {
  const bool shrinks = picture.cols > size.width;
  cv::Mat fitted;
  cv::resize(picture, fitted, size, 0.0, 0.0, shrinks ? cv::INTER_AREA : cv::INTER_NEAREST);
  return fitted;
}

}  // namespace

cv::Mat draw_channel_sheet(const cv::Mat& frame,
                           const std::vector<cv::Mat>& channels,
                           const std::vector<std::string>& captions) {
  STEMVO_CHECK(!frame.empty(), "a frame to show");
  STEMVO_CHECK(captions.size() == channels.size() + 1, "one caption per picture");
  const double frame_aspect = static_cast<double>(frame.cols) / frame.rows;
  const int columns = count_columns(captions.size(), frame_aspect);
  const int rows = (static_cast<int>(captions.size()) + columns - 1) / columns;
  const int cell_width_px =
      std::min(frame.cols, (kSheetWidth_px - kGap_px * (columns + 1)) / columns);
  const cv::Size cell(std::max(1, cell_width_px),
                      std::max(1, cvRound(cell_width_px / frame_aspect)));

  cv::Mat sheet(kGap_px + rows * (cell.height + kLabel_px + kGap_px / 2),
                kGap_px + columns * (cell.width + kGap_px), CV_8UC3, kPaper);
  for (std::size_t i = 0; i < captions.size(); ++i) {
    const int x = kGap_px + (static_cast<int>(i) % columns) * (cell.width + kGap_px);
    const int y =
        kGap_px + (static_cast<int>(i) / columns) * (cell.height + kLabel_px + kGap_px / 2);
    const cv::Mat& source = i == 0 ? frame : channels[i - 1];
    STEMVO_CHECK(!source.empty(), "a channel to show");
    fit(picture_of(source), cell).copyTo(sheet(cv::Rect({x, y}, cell)));
    put_caption(sheet, {x, y + cell.height, cell.width, kLabel_px}, captions[i], kInk);
  }
  return sheet;
}

}  // namespace stemvo
