// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "dataset/frame_source.hpp"
#include "evaluation/trajectory.hpp"
#include "html/page.hpp"
#include "report/metrics_json.hpp"
#include "stemvo/error.hpp"
#include "stemvo/frame_result.hpp"

namespace stemvo {

/// What report.html of a run shows: a pose per frame, at least one (checked), in the world of the
/// ground truth, which some frames may lack.
struct RunPage {
  std::string title;
  std::string subtitle;
  std::string unit = "m";  ///< of the trajectories
  const MetricsReport& report;
  std::span<const FrameResult> frames;
  std::span<const std::size_t> numbers;  ///< of the frames, in the sequence
  const Trajectory& estimate;            ///< after the alignment of report.metrics
  const std::optional<GroundTruth>& ground_truth;
  const std::vector<html::CaptionedImage>& images;
  std::string config;   ///< YAML
  std::string command;  ///< that repeats the run; may be empty
};

/// Top view with a slider over the frames, numbers, the path in 3D, errors over distance and by
/// segment length (with ground truth), tracks, states and R_H, scale and camera with their sigma,
/// time per stage, images, configuration. Error: the file cannot be written.
[[nodiscard]] Status write_run_page(const std::filesystem::path& file, const RunPage& run);

}  // namespace stemvo
