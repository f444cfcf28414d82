// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "dataset/frame_source.hpp"
#include "evaluation/trajectory.hpp"
#include "html/page.hpp"
#include "report/metrics_json.hpp"
#include "stemvo/error.hpp"

namespace stemvo {

/// The map of a run.
struct MapPage {
  Trajectory path;  ///< of all frames, aligned as the estimate
  std::vector<std::pair<std::size_t, std::size_t>> loops;  ///< frames that show one place
};

/// The content of a run's report.html: a row and a pose per frame, in the world of the ground
/// truth, which some frames may lack.
struct RunPage {
  std::string title;
  std::string subtitle;
  std::string unit = "m";  ///< in which the trajectories are
  const MetricsReport& report;
  const std::string& frames_csv;
  const Trajectory& estimate;         ///< after the alignment of report.metrics
  const std::optional<MapPage>& map;  ///< nullopt: nothing is remembered
  const std::optional<GroundTruth>& ground_truth;
  const std::vector<html::CaptionedImage>& images;
  const std::vector<html::CaptionedImage>& small_frames;  ///< under the slider
  std::string config;                                     ///< YAML
  std::string command;                                    ///< that repeats the run; may be empty
};

/// Path from above with a slider over the frames, numbers, the path in 3D, errors over distance and
/// by segment length (with ground truth), tracks, states and R_H, scale and camera with their
/// sigma, time per stage, images, configuration. Error: the file cannot be written.
[[nodiscard]] Status write_run_page(const std::filesystem::path& file, const RunPage& run);

}  // namespace stemvo
