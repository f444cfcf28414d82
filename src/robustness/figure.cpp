// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "robustness/robustness.hpp"

namespace stemvo::robustness {
namespace {

constexpr int kColumns = 4;
constexpr int kCellWidth = 400;
constexpr int kCellHeight = 290;
constexpr int kTitle = 40;
constexpr int kLegendLine = 28;
const cv::Rect kPlot(62, 44, 312, 190);  // in a cell
constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;
const cv::Scalar kInk(40, 40, 40);
const cv::Scalar kGrid(222, 222, 222);
// Okabe and Ito's colours, safe for the colour-blind; RGB.
const cv::Scalar kColors[] = {{0, 114, 178}, {213, 94, 0},   {0, 158, 115}, {204, 121, 167},
                              {230, 159, 0}, {86, 180, 233}, {0, 0, 0},     {150, 150, 150}};

/// A contender's line; after the colours are used up, thin and hollow.
struct Style {
  cv::Scalar color;
  int line = 2;
  int radius = 4;
  bool is_hollow = false;
};

Style style_of(std::size_t contender) {
  const bool is_again = contender >= std::size(kColors);
  return {kColors[contender % std::size(kColors)],
          contender == 0 ? 3
          : is_again     ? 1
                         : 2,
          contender == 0 ? 5 : 4, is_again};
}

void draw_marker(cv::Mat& image, cv::Point at, const Style& style) {
  cv::circle(image, at, style.radius, style.is_hollow ? cv::Scalar::all(255) : style.color,
             cv::FILLED, cv::LINE_AA);
  cv::circle(image, at, style.radius, style.color, 1, cv::LINE_AA);
}

void text(cv::Mat& image, const std::string& what, cv::Point at, double size = 0.45) {
  cv::putText(image, what, at, kFont, size, kInk, 1, cv::LINE_AA);
}

/// The rows of one disturbance, after the undisturbed one where there is one (alone: its own
/// panel).
struct Panel {
  std::string name;
  std::vector<const Row*> rows;
};

std::vector<Panel> panels_of(const RobustnessReport& report) {
  std::vector<Panel> panels;
  const Row* undisturbed = nullptr;
  for (const Row& row : report.rows) {
    if (row.disturbance == kUndisturbed) {
      undisturbed = &row;
      continue;
    }
    if (panels.empty() || panels.back().name != row.disturbance) {
      panels.push_back({row.disturbance, {}});
      if (undisturbed != nullptr) {
        panels.back().rows.push_back(undisturbed);
      }
    }
    panels.back().rows.push_back(&row);
  }
  if (panels.empty() && undisturbed != nullptr) {
    panels.push_back({"as the frames are", {undisturbed}});
  }
  return panels;
}

/// Rotation errors on a logarithmic axis; what lies beyond is drawn at its end.
class ErrorAxis {
 public:
  explicit ErrorAxis(const RobustnessReport& report) {
    double least = 1.0;
    for (const Row& row : report.rows) {
      for (const auto& outcomes : row.outcomes) {
        least = std::min(least, mean_rotation_error(outcomes).value_or(least));
      }
    }
    low_ = std::pow(10.0, std::floor(std::log10(std::max(least, 1e-3))));
  }

  [[nodiscard]] int to_px(double error) const {
    const double share = std::log(std::clamp(error, low_, kHigh) / low_) / std::log(kHigh / low_);
    return kPlot.y + kPlot.height - cvRound(share * kPlot.height);
  }
  [[nodiscard]] std::vector<double> ticks() const {
    std::vector<double> result;
    for (double tick = low_; tick < 1.5 * kHigh; tick *= 10.0) {
      result.push_back(tick);
    }
    return result;
  }

 private:
  static constexpr double kHigh = 10.0;  // degrees per 100 m
  double low_ = 0.1;
};

void draw_panel(const Panel& panel,
                const RobustnessReport& report,
                const ErrorAxis& axis,
                cv::Mat cell) {
  text(cell, panel.name, {kPlot.x, 30}, 0.55);
  const std::vector<double> ticks = axis.ticks();
  for (const double tick : ticks) {
    const int y = axis.to_px(tick);
    cv::line(cell, {kPlot.x, y}, {kPlot.x + kPlot.width, y}, kGrid);
    text(cell, fmt::format("{}{:g}", tick == ticks.back() ? ">=" : "", tick), {10, y + 5});
  }
  const int step = kPlot.width / static_cast<int>(std::max<std::size_t>(panel.rows.size(), 2));
  const auto x_of = [&](std::size_t i) { return kPlot.x + step / 2 + static_cast<int>(i) * step; };
  for (std::size_t i = 0; i < panel.rows.size(); ++i) {
    const Row& row = *panel.rows[i];
    text(cell, row.disturbance == kUndisturbed ? kUndisturbed : fmt::format("{:g}", row.strength),
         {x_of(i) - 14, kPlot.y + kPlot.height + 22});
  }
  for (std::size_t one = report.contenders.size(); one-- > 0;) {  // the judged one on top
    const Style style = style_of(one);
    std::vector<cv::Point> line;
    for (std::size_t i = 0; i < panel.rows.size(); ++i) {
      if (const auto error = mean_rotation_error(panel.rows[i]->outcomes[one])) {
        line.emplace_back(x_of(i), axis.to_px(*error));
      }
    }
    cv::polylines(cell, line, false, style.color, style.line, cv::LINE_AA);
    for (const cv::Point& at : line) {
      draw_marker(cell, at, style);
    }
  }
  cv::rectangle(cell, kPlot, kInk);
}

/// Where each contender stands in the legend, from the left top.
std::vector<cv::Point> legend_places(const std::vector<std::string>& contenders) {
  std::vector<cv::Point> places;
  cv::Point next(20, kTitle + kLegendLine / 2);
  for (const std::string& name : contenders) {
    const int width = 62 + cv::getTextSize(name, kFont, 0.5, 1, nullptr).width;
    if (next.x > 20 && next.x + width > kColumns * kCellWidth) {
      next = {20, next.y + kLegendLine};
    }
    places.push_back(next);
    next.x += width;
  }
  return places;
}

void draw_head(const RobustnessReport& report, cv::Mat& figure) {
  text(figure, "rotation error, degrees per 100 m, over the strength of a disturbance", {20, 26},
       0.6);
  const std::vector<cv::Point> places = legend_places(report.contenders);
  for (std::size_t one = 0; one < places.size(); ++one) {
    const cv::Point at = places[one];
    const Style style = style_of(one);
    cv::line(figure, at, at + cv::Point(30, 0), style.color, style.line, cv::LINE_AA);
    draw_marker(figure, at + cv::Point(15, 0), style);
    text(figure, report.contenders[one], at + cv::Point(38, 5), 0.5);
  }
}

}  // namespace

cv::Mat draw_figure(const RobustnessReport& report) {
  const std::vector<Panel> panels = panels_of(report);
  const int num_lines = (static_cast<int>(panels.size()) + kColumns - 1) / kColumns;
  const int head = legend_places(report.contenders).back().y + kLegendLine;
  cv::Mat figure(head + num_lines * kCellHeight, kColumns * kCellWidth, CV_8UC3,
                 cv::Scalar::all(255));
  draw_head(report, figure);
  const ErrorAxis axis(report);
  for (int i = 0; i < static_cast<int>(panels.size()); ++i) {
    const cv::Rect place(i % kColumns * kCellWidth, head + i / kColumns * kCellHeight, kCellWidth,
                         kCellHeight);
    draw_panel(panels[static_cast<std::size_t>(i)], report, axis, figure(place));
  }
  return figure;
}

}  // namespace stemvo::robustness
