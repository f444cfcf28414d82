// SPDX-License-Identifier: MIT
#pragma once

#include <optional>

#include "evaluation/trajectory.hpp"
#include "odometry/whole_map.hpp"
#include "stemvo/error.hpp"

namespace stemvo::pipeline {

struct Run;

/// The whole map behind the last frame.
struct MapResult {
  WholeMap whole;
  Trajectory trajectory;                              ///< of all frames, as result files hold it
  std::optional<double> adjustment_s = std::nullopt;  ///< it took
};

/// Adjusted where places were seen again, or where that is asked for; with
/// scale.source=ground_truth steps get their true length.
[[nodiscard]] MapResult finish_map(const Run& run);

/// map.ply: landmarks and the camera's path among them. Where steps are rescaled, both are.
[[nodiscard]] Status write_map_ply(const Run& run, const MapResult& map);

}  // namespace stemvo::pipeline
