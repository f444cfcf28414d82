// SPDX-License-Identifier: MIT
#include "report/plot_layout.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "internal_check.hpp"

namespace stemvo {

namespace {

constexpr double kMinWidth_px = 900.0;  // of the plot: the texts above it need the room
constexpr double kMaxWidth_px = 1400.0;
constexpr double kMinHeight_px = 480.0;
constexpr double kMaxHeight_px = 1100.0;
constexpr double kMinTick_px = 105.0;
constexpr double kMinSpan_m = 1.0;
constexpr double kAir = 0.06;  // share of the span left free on each side

}  // namespace

PlotLayout make_plot_layout(const std::vector<const Trajectory*>& trajectories) {
  Eigen::AlignedBox2d box;  // x, z
  for (const Trajectory* trajectory : trajectories) {
    for (const Rigid3& pose : *trajectory) {
      if (pose.translation.allFinite()) {
        box.extend(Eigen::Vector2d(pose.translation.x(), pose.translation.z()));
      }
    }
  }
  if (box.isEmpty()) {
    box.extend(Eigen::Vector2d::Zero());
  }
  // Air on both sides in terms of the longer side, so that a line is not drawn on the frame.
  const double air_m = 2.0 * kAir * std::max(box.sizes().maxCoeff(), kMinSpan_m);
  const Eigen::Vector2d span_m = box.sizes().array() + air_m;

  PlotLayout layout;
  layout.px_per_m =
      std::min({kMaxWidth_px / span_m.x(), kMaxHeight_px / span_m.y(), kMaxHeight_px / kMinSpan_m});
  layout.plot_width_px = std::max(kMinWidth_px, std::round(span_m.x() * layout.px_per_m));
  layout.plot_height_px = std::max(kMinHeight_px, std::round(span_m.y() * layout.px_per_m));
  layout.min_x_m = box.center().x() - 0.5 * layout.plot_width_px / layout.px_per_m;
  layout.min_z_m = box.center().y() - 0.5 * layout.plot_height_px / layout.px_per_m;
  layout.tick_m = round_tick(kMinTick_px / layout.px_per_m);
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
