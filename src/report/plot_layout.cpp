// SPDX-License-Identifier: MIT
#include "report/plot_layout.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/core.h>

#include "stemvo/check.hpp"

namespace stemvo {

namespace {

constexpr double kMarginLeft_px = 150.0;
constexpr double kMarginRight_px = 50.0;
constexpr double kMarginTop_px = 200.0;  // title, subtitle, legend
constexpr double kMarginBottom_px = 125.0;
constexpr double kLeastWidth_px = 900.0;  // of the plot: the texts above it need the room
constexpr double kMostWidth_px = 1400.0;
constexpr double kLeastHeight_px = 480.0;
constexpr double kMostHeight_px = 1100.0;
constexpr double kLeastTick_px = 105.0;
constexpr double kLeastSpan_m = 1.0;
constexpr double kAir = 0.06;  // share of the span left free on each side

struct Range {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();

  void add(double value) {
    low = std::min(low, value);
    high = std::max(high, value);
  }
  [[nodiscard]] double center() const { return 0.5 * (low + high); }
  [[nodiscard]] double span() const { return high - low; }
};

}  // namespace

PlotLayout make_plot_layout(const std::vector<const Trajectory*>& trajectories) {
  Range x;
  Range z;
  for (const Trajectory* trajectory : trajectories) {
    for (const Rigid3& pose : *trajectory) {
      if (pose.translation.allFinite()) {
        x.add(pose.translation.x());
        z.add(pose.translation.z());
      }
    }
  }
  if (!(x.low <= x.high)) {
    x = z = {0.0, 0.0};
  }
  // Air on both sides in terms of the longer side, so that a line is not drawn on the frame.
  const double air_m = 2.0 * kAir * std::max({x.span(), z.span(), kLeastSpan_m});
  const double span_x_m = x.span() + air_m;
  const double span_z_m = z.span() + air_m;

  PlotLayout layout;
  layout.px_per_m = std::min(
      {kMostWidth_px / span_x_m, kMostHeight_px / span_z_m, kMostHeight_px / kLeastSpan_m});
  layout.plot_width_px = std::max(kLeastWidth_px, std::round(span_x_m * layout.px_per_m));
  layout.plot_height_px = std::max(kLeastHeight_px, std::round(span_z_m * layout.px_per_m));
  layout.left_px = kMarginLeft_px;
  layout.top_px = kMarginTop_px;
  layout.width_px = kMarginLeft_px + layout.plot_width_px + kMarginRight_px;
  layout.height_px = kMarginTop_px + layout.plot_height_px + kMarginBottom_px;
  layout.min_x_m = x.center() - 0.5 * layout.plot_width_px / layout.px_per_m;
  layout.min_z_m = z.center() - 0.5 * layout.plot_height_px / layout.px_per_m;
  layout.tick_m = round_tick(kLeastTick_px / layout.px_per_m);
  return layout;
}

double round_tick(double least) {
  STEMVO_CHECK(least > 0.0 && std::isfinite(least), "a tick is a positive length");
  const double decade = std::pow(10.0, std::floor(std::log10(least)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * decade >= least * (1.0 - 1e-9)) {
      return factor * decade;
    }
  }
  return 10.0 * decade;
}

std::vector<double> tick_positions(double from, double to, double tick) {
  std::vector<double> positions;
  const double first = std::ceil(from / tick);
  const double last = std::floor(to / tick);
  for (double i = first; i <= last; i += 1.0) {
    positions.push_back(i * tick);
  }
  return positions;
}

std::string tick_label(double value, double tick) {
  const int decimals = std::max(0, static_cast<int>(-std::floor(std::log10(tick) + 1e-9)));
  const bool is_zero = std::abs(value) < 0.5 * tick;
  return fmt::format("{}{:.{}f}", value < 0.0 && !is_zero ? "\u2212" : "",
                     is_zero ? 0.0 : std::abs(value), decimals);
}

}  // namespace stemvo
