// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "config/config.hpp"
#include "pipeline/run.hpp"
#include "stemvo/error.hpp"

namespace stemvo {

struct BenchmarkRequest {
  std::filesystem::path kitti_root;  ///< holds sequences/NN and poses/NN.txt
  std::filesystem::path out_dir;
  std::filesystem::path published;     ///< the official sequences and published numbers
  std::vector<std::string> sequences;  ///< names of folders; empty: every folder that is there
  /// Configurations to measure, under names that are also folders', e.g. "default".
  std::vector<std::pair<std::string, Config>> configurations;
  int num_threads = 0;  ///< 0: all cores
  std::string command;  ///< that repeats it, for report.html; may be empty
  /// Before a run: "2/12 03, default, ground_truth", and why an earlier result does not count any
  /// more. Not called for results that are kept. False stops, here and after a frame.
  std::function<bool(const std::string& run)> on_run = {};
  RunProgress on_frame = {};
};

/// One line each, with the names of sequence, configuration and scale source.
struct BenchmarkSummary {
  std::vector<std::string> failures;  ///< sequences that cannot be read, runs that failed
  std::vector<std::string> warnings;  ///< of the runs done now
  std::string json;                   ///< what benchmark.json holds
  bool interrupted = false;
};

/// Runs every sequence under every configuration, with metres from the road (scale.source
/// camera_height) and with per-step ground-truth scale (ground_truth, the paper's protocol);
/// neither aligns anything afterwards. OUT gets runs/NN/NAME_SOURCE (all files of run_sequence),
/// benchmark.md, benchmark.json (no times in either), report.html and speed.json; they are written
/// after each sequence and when stopped. A run whose configuration, program, model, frames (names,
/// sizes), calib, times and pose file are those of a result in OUT is not repeated. A sequence or
/// run that fails is a row with its reason. Errors: no folder kitti_root/sequences, none in it,
/// `published` cannot be read, OUT cannot be written.
[[nodiscard]] Expected<BenchmarkSummary> run_benchmark(const BenchmarkRequest& request);

namespace benchmark {

/// "default, camera height".
[[nodiscard]] std::string name_of(const nlohmann::ordered_json& run);

/// "all 4541 frames", "clip 0:200 of 4541", "frames 0:60".
[[nodiscard]] std::string describe_frames(const nlohmann::ordered_json& sequence);

/// benchmark.json for people: a table over all sequences, then one per sequence with the
/// zero-motion baseline and, where all official frames ran, the published numbers.
[[nodiscard]] std::string format_markdown(const nlohmann::ordered_json& report);

/// Lists of {name, x, y, z} by the name of the sequence: the ground truth, and what was driven.
using SequencePaths = std::map<std::string, nlohmann::ordered_json>;
/// report.html: benchmark.json as figures. Error: the file cannot be written.
[[nodiscard]] Status write_page(const std::filesystem::path& file,
                                nlohmann::ordered_json report,
                                const SequencePaths& paths,
                                const BenchmarkRequest& request);

}  // namespace benchmark
}  // namespace stemvo
