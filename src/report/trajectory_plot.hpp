// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "evaluation/trajectory.hpp"
#include "stemvo/error.hpp"

namespace stemvo {

/// Top view of a drive: x to the right, z (forward) up, equal axes. Poses are drawn as they
/// are; give both trajectories in the same world (first pose = identity).
struct TrajectoryPlot {
  std::string title;     ///< UTF-8, may be empty
  std::string subtitle;  ///< the numbers, one line; may be empty
  Trajectory estimate;   ///< at least one pose (checked)
  std::optional<Trajectory> ground_truth;
  std::string unit = "m";  ///< of both axes
};

/// 1100 to 1600 pixels wide, 800 to 1430 high, after the drive's shape. The same plot gives the
/// same bytes on one machine (the fonts are the system's). Positions that are not finite are left
/// out. Error: the file cannot be written.
[[nodiscard]] Status write_trajectory_png(const std::filesystem::path& file,
                                          const TrajectoryPlot& plot);

}  // namespace stemvo
