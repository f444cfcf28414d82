// SPDX-License-Identifier: MIT
#include "stemvo/report/frame_picture.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/core.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "report/picture_drawing.hpp"
#include "report/plot_layout.hpp"
#include "stemvo/check.hpp"
#include "text/text_file.hpp"

namespace stemvo {

namespace {

constexpr int kBand_px = 40;  // above the pictures: caption and legend
constexpr int kGap_px = 4;
constexpr int kDefaultWidth_px = 1241;  // where there is neither frame nor channel
constexpr int kSubpixelBits = 4;
const cv::Scalar kBandColor(24, 24, 28);
const cv::Scalar kBandText(235, 235, 235);
const cv::Scalar kOutlier(230, 40, 30);

/// Flow that gets the brightest colour: 95 % of the inliers are below, rounded up to 1, 2, 5, 10...
double longest_flow_px(const Matches& matches, const std::vector<char>& inlier_mask) {
  std::vector<double> lengths;
  for (std::size_t i = 0; i < inlier_mask.size(); ++i) {
    const double length_px = (matches.cur_uv[i] - matches.prev_uv[i]).norm();
    if (inlier_mask[i] != 0 && std::isfinite(length_px)) {
      lengths.push_back(length_px);
    }
  }
  if (lengths.empty()) {
    return 1.0;
  }
  const auto at =
      lengths.begin() + static_cast<std::ptrdiff_t>(0.95 * static_cast<double>(lengths.size() - 1));
  std::nth_element(lengths.begin(), at, lengths.end());
  return round_tick(std::max(1.0, *at));
}

cv::Point to_subpixels(const Eigen::Vector2d& uv) {
  const Eigen::Vector2d scaled = uv * (1 << kSubpixelBits);
  return {cvRound(scaled.x()), cvRound(scaled.y())};
}

bool is_drawable(const Eigen::Vector2d& uv) {
  return uv.allFinite() && uv.cwiseAbs().maxCoeff() < 1e5;
}

/// `to_picture` maps input pixels to pixels of `rgb`.
template <typename Map>
void draw_matches(cv::Mat& rgb,
                  const Matches& matches,
                  const std::vector<char>& inlier_mask,
                  double longest_px,
                  const Map& to_picture) {
  // Outliers first: they may not hide what counts.
  for (const bool draw_inliers : {false, true}) {
    for (std::size_t i = 0; i < matches.cur_uv.size(); ++i) {
      const bool is_inlier = i < inlier_mask.size() && inlier_mask[i] != 0;
      const Eigen::Vector2d prev = to_picture(matches.prev_uv[i]);
      const Eigen::Vector2d cur = to_picture(matches.cur_uv[i]);
      if (is_inlier != draw_inliers || !is_drawable(prev) || !is_drawable(cur)) {
        continue;
      }
      const double length_px = (matches.cur_uv[i] - matches.prev_uv[i]).norm();
      const cv::Scalar color = is_inlier ? flow_color(length_px / longest_px) : kOutlier;
      cv::line(rgb, to_subpixels(prev), to_subpixels(cur), color, is_inlier ? 2 : 1, cv::LINE_AA,
               kSubpixelBits);
      if (is_inlier) {
        cv::circle(rgb, to_subpixels(cur), 2 << kSubpixelBits, color, cv::FILLED, cv::LINE_AA,
                   kSubpixelBits);
      }
    }
  }
}

/// Caption at the left, colours of the flow at the right.
void draw_band(cv::Mat& rgb, const std::string& caption, double longest_px, bool has_matches) {
  cv::Mat band = rgb.rowRange(0, kBand_px);
  band.setTo(kBandColor);
  const int legend_px = has_matches ? std::min(430, rgb.cols / 2) : 0;
  put_caption(rgb, {12, 0, rgb.cols - legend_px - 24, kBand_px}, caption, kBandText);
  if (!has_matches) {
    return;
  }
  const int bar_px = legend_px / 4;
  int x = rgb.cols - legend_px;
  put_caption(rgb, {x, 0, legend_px / 6, kBand_px}, "flow 0", kBandText);
  x += legend_px / 6 + 8;
  for (int i = 0; i < bar_px; ++i) {
    cv::line(rgb, {x + i, 12}, {x + i, kBand_px - 13}, flow_color(static_cast<double>(i) / bar_px),
             1);
  }
  x += bar_px + 8;
  put_caption(rgb, {x, 0, legend_px / 5, kBand_px}, fmt::format("{:g} px", longest_px), kBandText);
  x += legend_px / 5 + 8;
  cv::line(rgb, {x, kBand_px / 2}, {x + 24, kBand_px / 2}, kOutlier, 1, cv::LINE_AA);
  put_caption(rgb, {x + 32, 0, rgb.cols - x - 36, kBand_px}, "outlier", kBandText);
}

int height_at_width(const cv::Mat& picture, int width_px) {
  return picture.empty()
             ? 0
             : std::max(1, cvRound(static_cast<double>(width_px) * picture.rows / picture.cols));
}

}  // namespace

cv::Mat draw_frame_picture(const cv::Mat& frame,
                           const ChannelImage& channel,
                           const Matches& matches,
                           const std::vector<char>& inlier_mask,
                           const std::string& caption) {
  STEMVO_CHECK(matches.prev_uv.size() == matches.cur_uv.size(), "matches come in pairs");
  STEMVO_CHECK(inlier_mask.empty() || inlier_mask.size() == matches.cur_uv.size(),
               "one entry per match");
  const int width_px = !frame.empty()            ? frame.cols
                       : !channel.pixels.empty() ? channel.pixels.cols
                                                 : kDefaultWidth_px;
  const int channel_height_px = height_at_width(channel.pixels, width_px);
  const int gap_px = frame.empty() || channel.pixels.empty() ? 0 : kGap_px;
  cv::Mat picture(kBand_px + frame.rows + gap_px + channel_height_px, width_px, CV_8UC3,
                  kBandColor);
  const double longest_px = longest_flow_px(matches, inlier_mask);
  if (!frame.empty()) {
    cv::Mat part = picture.rowRange(kBand_px, kBand_px + frame.rows);
    to_rgb(frame).copyTo(part);
    draw_matches(part, matches, inlier_mask, longest_px,
                 [](const Eigen::Vector2d& uv) { return uv; });
  }
  if (!channel.pixels.empty()) {
    cv::Mat part = picture.rowRange(picture.rows - channel_height_px, picture.rows);
    cv::resize(to_rgb(channel.pixels), part, part.size(), 0.0, 0.0, cv::INTER_LINEAR);
    const Eigen::Vector2d zoom(static_cast<double>(width_px) / channel.pixels.cols,
                               static_cast<double>(channel_height_px) / channel.pixels.rows);
    draw_matches(part, matches, inlier_mask, longest_px, [&](const Eigen::Vector2d& uv) {
      // resize() keeps the pictures' corners together, so pixel centres move by half a pixel.
      return Eigen::Vector2d(
          ((channel.map.from_input(uv).array() + 0.5) * zoom.array() - 0.5).matrix());
    });
  }
  draw_band(picture, caption, longest_px, !matches.cur_uv.empty());
  return picture;
}

Status write_picture(const std::filesystem::path& file, const cv::Mat& picture) {
  cv::Mat bgr = picture;
  if (picture.channels() == 3) {
    bgr = cv::Mat();  // else the caller's pixels would be converted in place
    cv::cvtColor(picture, bgr, cv::COLOR_RGB2BGR);
  }
  std::vector<uchar> bytes;
  if (bgr.empty() || !cv::imencode(".png", bgr, bytes)) {
    return fail(fmt::format("{}: cannot encode a picture of {} x {} pixels", file.string(),
                            picture.cols, picture.rows));
  }
  return write_text_file(file, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

}  // namespace stemvo
