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
constexpr int kHead = 70;                // of the figure: the legend
const cv::Rect kPlot(62, 44, 312, 190);  // in a cell
constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;
const cv::Scalar kInk(40, 40, 40);
const cv::Scalar kGrid(222, 222, 222);
// Okabe and Ito's colours, safe for the colour-blind; RGB.
const cv::Scalar kColors[] = {{0, 114, 178}, {213, 94, 0},   {0, 158, 115}, {204, 121, 167},
                              {230, 159, 0}, {86, 180, 233}, {0, 0, 0},     {150, 150, 150}};

void text(cv::Mat& image, const std::string& what, cv::Point at, double size = 0.45) {
  cv::putText(image, what, at, kFont, size, kInk, 1, cv::LINE_AA);
}

/// The rows of one disturbance, after the undisturbed one where there is one.
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
  for (const double tick : axis.ticks()) {
    const int y = axis.to_px(tick);
    cv::line(cell, {kPlot.x, y}, {kPlot.x + kPlot.width, y}, kGrid);
    text(cell, fmt::format("{:g}", tick), {12, y + 5});
  }
  const int step = kPlot.width / static_cast<int>(std::max<std::size_t>(panel.rows.size(), 2));
  const auto x_of = [&](std::size_t i) { return kPlot.x + step / 2 + static_cast<int>(i) * step; };
  for (std::size_t i = 0; i < panel.rows.size(); ++i) {
    const Row& row = *panel.rows[i];
    text(cell, row.disturbance == kUndisturbed ? kUndisturbed : fmt::format("{:g}", row.strength),
         {x_of(i) - 14, kPlot.y + kPlot.height + 22});
  }
  for (std::size_t one = report.contenders.size(); one-- > 0;) {  // the judged one on top
    const cv::Scalar& color = kColors[one % std::size(kColors)];
    std::vector<cv::Point> line;
    for (std::size_t i = 0; i < panel.rows.size(); ++i) {
      if (const auto error = mean_rotation_error(panel.rows[i]->outcomes[one])) {
        line.emplace_back(x_of(i), axis.to_px(*error));
        cv::circle(cell, line.back(), one == 0 ? 5 : 4, color, cv::FILLED, cv::LINE_AA);
      }
    }
    cv::polylines(cell, line, false, color, one == 0 ? 3 : 2, cv::LINE_AA);
  }
  cv::rectangle(cell, kPlot, kInk);
}

void draw_head(const RobustnessReport& report, cv::Mat head) {
  text(head, "rotation error, degrees per 100 m, over the strength of a disturbance", {20, 26},
       0.6);
  int x = 20;
  for (std::size_t one = 0; one < report.contenders.size(); ++one) {
    cv::line(head, {x, 50}, {x + 30, 50}, kColors[one % std::size(kColors)], 3, cv::LINE_AA);
    text(head, report.contenders[one], {x + 38, 55}, 0.5);
    x += 62 + cv::getTextSize(report.contenders[one], kFont, 0.5, 1, nullptr).width;
  }
}

}  // namespace

cv::Mat draw_figure(const RobustnessReport& report) {
  const std::vector<Panel> panels = panels_of(report);
  const int num_lines = (static_cast<int>(panels.size()) + kColumns - 1) / kColumns;
  cv::Mat figure(kHead + num_lines * kCellHeight, kColumns * kCellWidth, CV_8UC3,
                 cv::Scalar::all(255));
  draw_head(report, figure.rowRange(0, kHead));
  const ErrorAxis axis(report);
  for (int i = 0; i < static_cast<int>(panels.size()); ++i) {
    const cv::Rect place(i % kColumns * kCellWidth, kHead + i / kColumns * kCellHeight, kCellWidth,
                         kCellHeight);
    draw_panel(panels[static_cast<std::size_t>(i)], report, axis, figure(place));
  }
  return figure;
}

}  // namespace stemvo::robustness
