// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <vector>

#include "evaluation/trajectory.hpp"

namespace stemvo {

/// Where the figure's parts lie. Pixels, y down; the plot shows x to the right and z up with one
/// scale for both.
struct PlotLayout {
  static constexpr double kLeft_px = 150.0;  ///< of the plot's frame
  static constexpr double kTop_px = 200.0;   ///< title, subtitle, legend
  static constexpr double kMarginRight_px = 50.0;
  static constexpr double kMarginBottom_px = 125.0;

  double plot_width_px = 0.0;
  double plot_height_px = 0.0;
  double min_x_m = 0.0;  ///< at the left edge of the plot
  double min_z_m = 0.0;  ///< at the bottom edge
  double px_per_m = 1.0;
  double tick_m = 1.0;  ///< between grid lines, on both axes

  [[nodiscard]] double right_px() const { return kLeft_px + plot_width_px; }
  [[nodiscard]] double bottom_px() const { return kTop_px + plot_height_px; }
  [[nodiscard]] double width_px() const { return right_px() + kMarginRight_px; }
  [[nodiscard]] double height_px() const { return bottom_px() + kMarginBottom_px; }
  [[nodiscard]] double to_px_x(double x_m) const { return kLeft_px + (x_m - min_x_m) * px_per_m; }
  [[nodiscard]] double to_px_y(double z_m) const {
    return bottom_px() - (z_m - min_z_m) * px_per_m;
  }
  [[nodiscard]] double max_x_m() const { return min_x_m + plot_width_px / px_per_m; }
  [[nodiscard]] double max_z_m() const { return min_z_m + plot_height_px / px_per_m; }
};

/// A frame that holds every finite position of all trajectories with some air around; long thin
/// drives get a wider one, a single pose gets one metre.
[[nodiscard]] PlotLayout make_plot_layout(const std::vector<const Trajectory*>& trajectories);

/// The smallest of 1, 2, 5 times a power of ten that is not below `least` (> 0).
[[nodiscard]] double round_tick(double least);
/// Multiples of the tick within [from, to].
[[nodiscard]] std::vector<double> tick_positions(double from, double to, double tick);
/// With as many decimals as the tick needs and a true minus sign (UTF-8).
[[nodiscard]] std::string tick_label(double value, double tick);

}  // namespace stemvo
