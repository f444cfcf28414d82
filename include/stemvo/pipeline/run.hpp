// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "stemvo/config.hpp"
#include "stemvo/dataset/sequence.hpp"
#include "stemvo/error.hpp"
#include "stemvo/evaluation/metrics.hpp"
#include "stemvo/odometry/odometry.hpp"

namespace stemvo {

/// Everything `stemvo run` was asked for.
struct RunRequest {
  std::filesystem::path sequence_dir;
  std::filesystem::path out_dir;
  std::filesystem::path models_dir;
  Config config;
  std::optional<FrameRangeRequest> frames;
  std::optional<std::filesystem::path> ground_truth;
  int num_threads = 0;    ///< 0: all cores
  int picture_every = 0;  ///< 0: no per-frame pictures
};

/// What metrics.json holds (see docs/conventions.md and the README).
struct RunSummary {
  std::string sequence;
  std::size_t num_frames = 0;
  double fps = 0.0;
  double tracked_fraction = 0.0;
  std::string scale_source;
  StemInfo stem;
  std::optional<Metrics> metrics;     ///< absent without ground truth
  std::vector<std::string> warnings;  ///< broken frames and the like, one line each
  bool interrupted = false;           ///< stopped early; results hold what was computed
};

/// Called after each frame: frames done, frames in all; false stops the run (results are written).
using RunProgress = std::function<bool(std::size_t, std::size_t)>;

/// Opens the sequence, runs the odometry over it and writes every result file into out_dir
/// (trajectory_kitti.txt, trajectory_tum.txt, frames.csv, config.yaml, metrics.json,
/// trajectory.png, trajectory.svg, pictures). Errors are found before work starts.
[[nodiscard]] Expected<RunSummary> run_sequence(const RunRequest& request,
                                                const RunProgress& progress = {});

}  // namespace stemvo
