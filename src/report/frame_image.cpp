// SPDX-License-Identifier: MIT
#include "report/frame_image.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "internal_check.hpp"
#include "io/image_file.hpp"
#include "io/png.hpp"
#include "text/text_file.hpp"

namespace stemvo {
namespace {

constexpr int kBand_px = 40;  // above a frame's images: the caption
constexpr int kGap_px = 4;
constexpr int kDefaultWidth_px = 1241;  // where there is neither frame nor channel
constexpr int kSubpixelBits = 4;
const cv::Scalar kBandColor(24, 24, 28);
const cv::Scalar kBandText(235, 235, 235);
const cv::Scalar kOutlier(230, 40, 30);

constexpr int kSheetWidth_px = 2000;
constexpr int kSheetGap_px = 16;
constexpr int kLabel_px = 34;
constexpr double kSheetAspect = 1.4;  // width over height aimed at
const cv::Scalar kPaper(255, 255, 255);
const cv::Scalar kInk(34, 34, 34);

cv::Mat to_rgb(const cv::Mat& image) {
  STEMVO_CHECK(image.type() == CV_8UC1 || image.type() == CV_8UC3, "8-bit gray or RGB");
  cv::Mat rgb = image.clone();
  if (image.channels() == 1) {
    cv::cvtColor(image, rgb, cv::COLOR_GRAY2RGB);
  }
  return rgb;
}

/// Colour of a flow of `share` (0..1) of the longest: blue over green to yellow, growing brighter.
cv::Scalar flow_color(double share) {
  // The upper two thirds of viridis: they stand out on dark and bright gray, and no red is in them.
  static const std::array<cv::Vec3d, 5> kStops{
      {{38, 110, 190}, {33, 150, 160}, {60, 190, 110}, {160, 218, 57}, {253, 231, 37}}};
  const double position = std::clamp(share, 0.0, 1.0) * (kStops.size() - 1);
  const std::size_t below = std::min(static_cast<std::size_t>(position), kStops.size() - 2);
  const double part = position - static_cast<double>(below);
  const cv::Vec3d color = (1.0 - part) * kStops[below] + part * kStops[below + 1];
  return {color[0], color[1], color[2]};
}

/// Flow that gets the brightest colour: 95 % of the inliers are below, whole pixels.
double longest_flow_px(const Matches& matches, const std::vector<char>& inlier_mask) {
  std::vector<double> lengths;
  for (std::size_t i = 0; i < inlier_mask.size(); ++i) {
    if (inlier_mask[i] != 0) {
      lengths.push_back((matches.cur_uv[i] - matches.prev_uv[i]).norm());
    }
  }
  if (lengths.empty()) {
    return 1.0;
  }
  const auto at =
      lengths.begin() + static_cast<std::ptrdiff_t>(0.95 * static_cast<double>(lengths.size() - 1));
  std::nth_element(lengths.begin(), at, lengths.end());
  return std::ceil(std::max(1.0, *at));
}

cv::Point to_subpixels(const Eigen::Vector2d& uv) {
  const Eigen::Vector2d scaled = uv * (1 << kSubpixelBits);
  return {cvRound(scaled.x()), cvRound(scaled.y())};
}

template <typename Map>
void draw_matches(cv::Mat& rgb,
                  const Matches& matches,
                  const std::vector<char>& inlier_mask,
                  double longest_px,
                  const Map& to_image) {
  // Outliers first: they may not hide what counts.
  for (const bool draw_inliers : {false, true}) {
    for (std::size_t i = 0; i < matches.cur_uv.size(); ++i) {
      const bool is_inlier = i < inlier_mask.size() && inlier_mask[i] != 0;
      if (is_inlier != draw_inliers) {
        continue;
      }
      const cv::Point prev = to_subpixels(to_image(matches.prev_uv[i]));
      const cv::Point cur = to_subpixels(to_image(matches.cur_uv[i]));
      const double length_px = (matches.cur_uv[i] - matches.prev_uv[i]).norm();
      const cv::Scalar color = is_inlier ? flow_color(length_px / longest_px) : kOutlier;
      cv::line(rgb, prev, cur, color, is_inlier ? 2 : 1, cv::LINE_AA, kSubpixelBits);
      if (is_inlier) {
        cv::circle(rgb, cur, 2 << kSubpixelBits, color, cv::FILLED, cv::LINE_AA, kSubpixelBits);
      }
    }
  }
}

int height_at_width(const cv::Mat& image, int width_px) {
  return image.empty()
             ? 0
             : std::max(1, cvRound(static_cast<double>(width_px) * image.rows / image.cols));
}

/// Smaller by averaging; larger by repeating, so that a coarse channel shows its own pixels.
cv::Mat fit(const cv::Mat& image, const cv::Size& size) {
  const bool shrinks = image.cols > size.width;
  cv::Mat fitted;
  cv::resize(image, fitted, size, 0.0, 0.0, shrinks ? cv::INTER_AREA : cv::INTER_NEAREST);
  return fitted;
}

}  // namespace

int put_caption(cv::Mat& image,
                const cv::Rect& box,
                const std::string& text,
                const cv::Scalar& color,
                double share) {
  constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;
  if (text.empty() || box.width <= 0) {
    return box.x;
  }
  double scale = cv::getFontScaleFromHeight(kFont, std::max(6, box.height * 2 / 5));
  const cv::Size natural = cv::getTextSize(text, kFont, scale, 1, nullptr);
  scale *= std::min(1.0, static_cast<double>(box.width) / natural.width);
  const cv::Size size = cv::getTextSize(text, kFont, scale, 1, nullptr);
  const int x = box.x + cvRound(share * (box.width - size.width));
  cv::putText(image, text, {x, box.y + (box.height + size.height) / 2}, kFont, scale, color, 1,
              cv::LINE_AA);
  return x + size.width;
}

cv::Mat draw_frame_image(const cv::Mat& frame,
                         const ChannelImage& channel,
                         const Matches& matches,
                         const std::vector<char>& inlier_mask) {
  STEMVO_CHECK(matches.prev_uv.size() == matches.cur_uv.size(), "matches come in pairs");
  STEMVO_CHECK(inlier_mask.empty() || inlier_mask.size() == matches.cur_uv.size(),
               "one entry per match");
  const int width_px = !frame.empty()            ? frame.cols
                       : !channel.pixels.empty() ? channel.pixels.cols
                                                 : kDefaultWidth_px;
  const int channel_height_px = height_at_width(channel.pixels, width_px);
  const int gap_px = frame.empty() || channel.pixels.empty() ? 0 : kGap_px;
  const int height_px = std::max(1, frame.rows + gap_px + channel_height_px);
  cv::Mat image(height_px, width_px, CV_8UC3, kBandColor);
  const double longest_px = longest_flow_px(matches, inlier_mask);
  if (!frame.empty()) {
    cv::Mat part = image.rowRange(0, frame.rows);
    to_rgb(frame).copyTo(part);
    draw_matches(part, matches, inlier_mask, longest_px,
                 [&](const Eigen::Vector2d& uv) { return channel.map.lens.distort(uv); });
  }
  if (!channel.pixels.empty()) {
    cv::Mat part = image.rowRange(image.rows - channel_height_px, image.rows);
    cv::resize(to_rgb(channel.pixels), part, part.size(), 0.0, 0.0, cv::INTER_LINEAR);
    const Eigen::Vector2d zoom(static_cast<double>(width_px) / channel.pixels.cols,
                               static_cast<double>(channel_height_px) / channel.pixels.rows);
    draw_matches(part, matches, inlier_mask, longest_px, [&](const Eigen::Vector2d& uv) {
      // resize() keeps the images' corners together, so pixel centres move by half a pixel.
      return Eigen::Vector2d(
          ((channel.map.from_input(uv).array() + 0.5) * zoom.array() - 0.5).matrix());
    });
  }
  return image;
}

std::string describe_flow(const Matches& matches, const std::vector<char>& inlier_mask) {
  return matches.cur_uv.empty() ? ""
                                : fmt::format("flow 0 (blue) to {:g} px (yellow), outliers red",
                                              longest_flow_px(matches, inlier_mask));
}

cv::Mat draw_under_caption(const cv::Mat& image,
                           const std::string& left,
                           const std::string& right) {
  cv::Mat result(kBand_px + image.rows, image.cols, CV_8UC3, kBandColor);
  image.copyTo(result.rowRange(kBand_px, result.rows));
  put_caption(result, {12, 0, image.cols * 3 / 5, kBand_px}, left, kBandText);
  put_caption(result, {image.cols * 3 / 5 + 24, 0, image.cols * 2 / 5 - 36, kBand_px}, right,
              kBandText, 1.0);
  return result;
}

cv::Mat draw_sheet(const std::vector<cv::Mat>& images, const std::vector<std::string>& captions) {
  STEMVO_CHECK(!images.empty() && images.size() == captions.size(), "one caption per image");
  const cv::Size full = images.front().size();
  const auto count = static_cast<double>(images.size());
  // The number that brings the sheet nearest to its aspect.
  const double nearest =
      std::sqrt(count * kSheetAspect / (static_cast<double>(full.width) / full.height));
  const int columns = static_cast<int>(std::clamp(std::round(nearest), 1.0, count));
  const int rows = (static_cast<int>(images.size()) + columns - 1) / columns;
  const int width_px = (kSheetWidth_px - kSheetGap_px * (columns + 1)) / columns;
  const int cell_px = std::max(1, std::min(full.width, width_px));
  const cv::Size cell(cell_px, height_at_width(images.front(), cell_px));
  const int step_px = cell.height + kLabel_px + kSheetGap_px / 2;
  cv::Mat sheet(kSheetGap_px + rows * step_px, kSheetGap_px + columns * (cell.width + kSheetGap_px),
                CV_8UC3, kPaper);
  for (int i = 0; i < static_cast<int>(images.size()); ++i) {
    const cv::Mat& image = images[static_cast<std::size_t>(i)];
    const int x = kSheetGap_px + (i % columns) * (cell.width + kSheetGap_px);
    const int y = kSheetGap_px + (i / columns) * step_px;
    fit(to_rgb(image), cell).copyTo(sheet(cv::Rect({x, y}, cell)));
    put_caption(sheet, {x, y + cell.height, cell.width, kLabel_px},
                captions[static_cast<std::size_t>(i)], kInk);
  }
  return sheet;
}

std::string encode_jpeg(const cv::Mat& image, int width) {
  constexpr int kQuality = 80;
  if (image.cols <= width) {
    return io::encode_jpeg(image, kQuality);
  }
  const int height = std::max(1, cvRound(image.rows * (1.0 * width / image.cols)));
  cv::Mat smaller;
  cv::resize(image, smaller, {width, height}, 0, 0, cv::INTER_AREA);
  return io::encode_jpeg(smaller, kQuality);
}

Status write_image(const std::filesystem::path& file, const cv::Mat& image) {
  return write_text_file(file, io::encode_png(image));
}

}  // namespace stemvo
