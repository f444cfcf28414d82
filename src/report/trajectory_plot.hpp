// SPDX-License-Identifier: MIT
#pragma once

#include <optional>
#include <string>

#include <opencv2/core.hpp>

#include "evaluation/trajectory.hpp"

namespace stemvo {

/// Top view of a drive: x to the right, z (forward) up, equal axes. Poses are drawn as they
/// are; give both trajectories in the same world (first pose = identity).
struct TrajectoryPlot {
  std::string title;     ///< may be empty
  std::string subtitle;  ///< the numbers, one line; may be empty
  Trajectory estimate;   ///< at least one pose (checked)
  std::optional<Trajectory> ground_truth;
  std::string unit = "m";  ///< in which both axes are
};

/// 1100 to 1600 pixels wide, 780 to 1400 high, after the drive's shape; CV_8UC3, RGB.
[[nodiscard]] cv::Mat draw_trajectory(const TrajectoryPlot& plot);
/// The path alone, at least one pose, in a square of this side, beside a bar that tells its size.
[[nodiscard]] cv::Mat draw_path(const Trajectory& path, int side_px, const std::string& unit);

}  // namespace stemvo
