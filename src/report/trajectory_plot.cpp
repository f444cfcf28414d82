// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Geometry>
#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "internal_check.hpp"
#include "report/frame_image.hpp"

namespace stemvo {
namespace {

// Okabe and Ito's colours (safe for the colour-blind) on neutral grays.
const cv::Scalar kPlotInk(34, 34, 34);
const cv::Scalar kGrid(230, 230, 230);
const cv::Scalar kTruth(158, 158, 158);
const cv::Scalar kEstimate(0, 114, 178);
const cv::Scalar kStart(0, 158, 115);
const cv::Scalar kEnd(213, 94, 0);
const cv::Scalar kWhite = cv::Scalar::all(255);

// The truth is a broad gray road under the thin estimate: both stay visible where they agree.
constexpr int kTruthWidth_px = 9;
constexpr int kEstimateWidth_px = 3;
constexpr int kMarker_px = 10;

constexpr int kLeft_px = 150;
constexpr int kTop_px = 180;
constexpr int kRight_px = 50;
constexpr int kBottom_px = 120;
constexpr int kLine_px = 50;  // of text
constexpr double kTick_px = 105.0;
constexpr int kPlotSubpixelBits = 4;

Eigen::Vector2d seen_from_above(const Rigid3& pose) {
  return {pose.translation.x(), pose.translation.z()};
}

/// Where metres are in the figure: one scale for both axes, with some air around all positions.
struct View {
  cv::Rect frame;
  Eigen::Vector2d low_m;  ///< at the lower left corner
  double px_per_m = 1.0;

  explicit View(const Eigen::AlignedBox2d& box) {
    const double air_m = 0.12 * std::max(box.sizes().maxCoeff(), 1.0);
    const Eigen::Vector2d span_m = box.sizes().array() + air_m;
    px_per_m = std::min(1400.0 / span_m.x(), 1100.0 / span_m.y());
    frame = {kLeft_px, kTop_px, std::max(900, cvRound(span_m.x() * px_per_m)),
             std::max(480, cvRound(span_m.y() * px_per_m))};
    low_m = box.center() - 0.5 / px_per_m * Eigen::Vector2d(frame.width, frame.height);
  }
  View(const Eigen::AlignedBox2d& box, int side_px) : frame(0, 0, side_px, side_px) {
    const double side_m = 1.5 * std::max(box.sizes().maxCoeff(), 0.1);
    px_per_m = side_px / side_m;
    low_m = box.center() - Eigen::Vector2d::Constant(0.5 * side_m);
  }
  [[nodiscard]] cv::Point2d to_px(const Eigen::Vector2d& xz_m) const {
    const Eigen::Vector2d px = px_per_m * (xz_m - low_m);
    return {frame.x + px.x(), frame.br().y - px.y()};
  }
};

/// The smallest of 1, 2, 5 times a power of ten that is not below `least`.
double round_tick(double least) {
  const double decade = std::pow(10.0, std::floor(std::log10(least)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * decade >= least) {
      return factor * decade;
    }
  }
  return 10.0 * decade;
}

void draw_grid(const View& view, const std::string& unit, cv::Mat& image) {
  const cv::Rect& frame = view.frame;
  const double tick_m = round_tick(kTick_px / view.px_per_m);
  const Eigen::Vector2d high_m =
      view.low_m + Eigen::Vector2d(frame.width, frame.height) / view.px_per_m;
  const auto for_each_tick = [&](int axis, const auto& draw) {
    for (double i = std::ceil(view.low_m[axis] / tick_m); i * tick_m <= high_m[axis]; i += 1.0) {
      const cv::Point2d at = view.to_px(Eigen::Vector2d::Constant(i * tick_m));
      draw(cvRound(axis == 0 ? at.x : at.y), fmt::format("{:g}", i * tick_m + 0.0));
    }
  };
  for_each_tick(0, [&](int x, const std::string& label) {
    cv::line(image, {x, frame.y}, {x, frame.br().y}, kGrid, 2);
    put_caption(image, {x - 50, frame.br().y, 100, kLine_px}, label, kPlotInk, 0.5);
  });
  for_each_tick(1, [&](int y, const std::string& label) {
    cv::line(image, {frame.x, y}, {frame.br().x, y}, kGrid, 2);
    put_caption(image, {0, y - kLine_px / 2, frame.x - 12, kLine_px}, label, kPlotInk, 1.0);
  });
  cv::rectangle(image, frame, cv::Scalar::all(115), 2);
  put_caption(image, {frame.x, frame.br().y + kLine_px, frame.width, kLine_px},
              fmt::format("x, to the right [{}]", unit), kPlotInk, 0.5);
  cv::Mat upright(kLine_px, frame.height, CV_8UC3, kWhite);
  put_caption(upright, {0, 0, frame.height, kLine_px}, fmt::format("z, forward [{}]", unit),
              kPlotInk, 0.5);
  cv::rotate(upright, image(cv::Rect(8, frame.y, kLine_px, frame.height)),
             cv::ROTATE_90_COUNTERCLOCKWISE);
}

void draw_path(const Trajectory& path,
               const View& view,
               const cv::Scalar& color,
               int width_px,
               cv::Mat& image) {
  std::vector<cv::Point> points;
  for (const Rigid3& pose : path) {
    points.emplace_back(view.to_px(seen_from_above(pose)) * (1 << kPlotSubpixelBits));
  }
  cv::polylines(image, points, false, color, width_px, cv::LINE_AA, kPlotSubpixelBits);
}

/// A disk for the start, a square for the end, with a white rim: on a loop both fall together, and
/// the square's corners stay visible.
void draw_marker(bool is_start, const cv::Point& at, cv::Mat& image) {
  for (const auto& [color, size] :
       {std::pair(kWhite, kMarker_px + 3), std::pair(is_start ? kStart : kEnd, kMarker_px)}) {
    if (is_start) {
      cv::circle(image, at, size, color, cv::FILLED, cv::LINE_AA);
    } else {
      cv::rectangle(image, at - cv::Point(size, size), at + cv::Point(size, size), color,
                    cv::FILLED);
    }
  }
}

void draw_legend(bool has_truth, cv::Mat& image) {
  constexpr int kY_px = kTop_px - kLine_px / 2;
  int x = kLeft_px;
  const auto name_sample = [&](const char* name, int sample_px) {
    x = put_caption(image, {x + sample_px, kTop_px - kLine_px, 400, kLine_px}, name, kPlotInk) + 40;
  };
  const auto add_line = [&](const char* name, const cv::Scalar& color, int width_px) {
    cv::line(image, {x, kY_px}, {x + 54, kY_px}, color, width_px, cv::LINE_AA);
    name_sample(name, 70);
  };
  if (has_truth) {
    add_line("ground truth", kTruth, kTruthWidth_px);
  }
  add_line("estimate", kEstimate, kEstimateWidth_px);
  for (const bool is_start : {true, false}) {
    draw_marker(is_start, {x + kMarker_px, kY_px}, image);
    name_sample(is_start ? "start" : "end", 32);
  }
}

Eigen::AlignedBox2d box_of(const Trajectory& path) {
  Eigen::AlignedBox2d box;
  for (const Rigid3& pose : path) {
    box.extend(seen_from_above(pose));
  }
  return box;
}

}  // namespace

cv::Mat draw_path(const Trajectory& path, int side_px, const std::string& unit) {
  STEMVO_CHECK(!path.empty(), "at least one pose to draw");
  const View view(box_of(path), side_px);
  cv::Mat image(side_px, side_px, CV_8UC3, kWhite);
  draw_path(path, view, kEstimate, kEstimateWidth_px, image);
  draw_marker(true, view.to_px(seen_from_above(path.front())), image);
  draw_marker(false, view.to_px(seen_from_above(path.back())), image);
  const double bar_m = round_tick(side_px / (8.0 * view.px_per_m));
  const int end_px = 12 + cvRound(bar_m * view.px_per_m);
  cv::line(image, {12, side_px - 16}, {end_px, side_px - 16}, kPlotInk, 2);
  put_caption(image, {end_px + 8, side_px - 32, side_px / 3, 32},
              fmt::format("{:g} {}", bar_m, unit), kPlotInk);
  return image;
}

cv::Mat draw_trajectory(const TrajectoryPlot& plot) {
  STEMVO_CHECK(!plot.estimate.empty(), "at least one pose to draw");
  const View view(box_of(plot.estimate).merged(box_of(plot.ground_truth.value_or(plot.estimate))));
  const int width_px = view.frame.br().x + kRight_px;
  cv::Mat image(view.frame.br().y + kBottom_px, width_px, CV_8UC3, kWhite);
  const int room_px = width_px - kLeft_px - kRight_px;
  put_caption(image, {kLeft_px, 10, room_px, 70}, plot.title, kPlotInk);
  put_caption(image, {kLeft_px, 75, room_px, kLine_px}, plot.subtitle, cv::Scalar::all(90));
  draw_legend(plot.ground_truth.has_value(), image);
  draw_grid(view, plot.unit, image);
  if (plot.ground_truth) {
    draw_path(*plot.ground_truth, view, kTruth, kTruthWidth_px, image);
  }
  draw_path(plot.estimate, view, kEstimate, kEstimateWidth_px, image);
  draw_marker(false, view.to_px(seen_from_above(plot.estimate.back())), image);
  draw_marker(true, view.to_px(seen_from_above(plot.estimate.front())), image);
  return image;
}

}  // namespace stemvo
