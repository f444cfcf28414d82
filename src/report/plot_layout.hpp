// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <vector>

#include "stemvo/evaluation/trajectory.hpp"

namespace stemvo {

/// Where the figure's parts lie. Pixels, y down; the plot shows x to the right and z up with one
/// scale for both.
struct PlotLayout {
  double width_px = 0.0;  ///< of the whole figure
  double height_px = 0.0;
  double left_px = 0.0;  ///< of the plot's frame
  double top_px = 0.0;
  double plot_width_px = 0.0;
  double plot_height_px = 0.0;
  double min_x_m = 0.0;  ///< at the left edge of the plot
  double min_z_m = 0.0;  ///< at the bottom edge
  double px_per_m = 1.0;
  double tick_m = 1.0;  ///< between grid lines, on both axes

  [[nodiscard]] double to_px_x(double x_m) const { return left_px + (x_m - min_x_m) * px_per_m; }
  [[nodiscard]] double to_px_y(double z_m) const {
    return top_px + plot_height_px - (z_m - min_z_m) * px_per_m;
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
