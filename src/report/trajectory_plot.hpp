// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "evaluation/trajectory.hpp"
#include "stemvo/error.hpp"

namespace stemvo {

/// One more estimate of the same drive, with its name for the legend.
struct NamedTrajectory {
  std::string name;
  Trajectory trajectory;
};

/// Top view of a drive: x to the right, z (forward) up, equal axes. Poses are drawn as they
/// are; give both trajectories in the same world (first pose = identity).
struct TrajectoryPlot {
  std::string title;     ///< UTF-8, may be empty
  std::string subtitle;  ///< the numbers, one line; may be empty
  Trajectory estimate;   ///< at least one pose (checked)
  std::optional<Trajectory> ground_truth;
  std::string unit = "m";                    ///< of both axes
  std::string estimate_name = "estimate";    ///< for the legend
  std::vector<NamedTrajectory> others = {};  ///< drawn under the estimate, in colours of their own
};

/// 1100 to 1600 pixels wide, 800 to 1430 high, after the drive's shape. The same plot gives the
/// same bytes on one machine (the fonts are the system's). Positions that are not finite are left
/// out. Error: the file cannot be written.
[[nodiscard]] Status write_trajectory_png(const std::filesystem::path& file,
                                          const TrajectoryPlot& plot);
/// The same drawing as vectors.
[[nodiscard]] Status write_trajectory_svg(const std::filesystem::path& file,
                                          const TrajectoryPlot& plot);

}  // namespace stemvo
