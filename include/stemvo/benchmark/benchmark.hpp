// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "stemvo/config.hpp"
#include "stemvo/dataset/sequence.hpp"
#include "stemvo/error.hpp"
#include "stemvo/report/metrics_json.hpp"

namespace stemvo {

/// Where metres come from. Neither aligns anything afterwards.
enum class ScaleProtocol {
  kCameraHeight,     ///< from the road (scale.source: camera_height); no ground truth
  kGroundTruthSteps  ///< each step takes its true length (the paper's protocol)
};
[[nodiscard]] std::string_view to_string(ScaleProtocol protocol);  ///< `camera_height`, ..

/// What is measured: a configuration under a name that is also a folder's, e.g. "default".
struct BenchmarkConfiguration {
  std::string name;
  Config config;
};

struct BenchmarkRequest {
  std::filesystem::path kitti_root;  ///< holds sequences/NN and poses/NN.txt
  std::filesystem::path out_dir;
  std::filesystem::path models_dir;
  std::vector<std::string> sequences;  ///< names of folders; empty: every folder that is there
  std::vector<BenchmarkConfiguration> configurations;
  int num_threads = 0;  ///< 0: all cores
};

enum class BenchmarkState {
  kPending,      ///< not run yet (an interrupt)
  kDone,         ///< now
  kKept,         ///< by an earlier call, with the same inputs
  kNotPossible,  ///< no ground truth to take steps from, or the configuration has no such scale
  kFailed
};

/// One sequence under one configuration and protocol.
struct BenchmarkRun {
  std::string configuration;
  ScaleProtocol protocol = ScaleProtocol::kCameraHeight;
  BenchmarkState state = BenchmarkState::kPending;
  std::optional<MetricsReport> report;  ///< where done or kept; its metrics need ground truth
  std::string problem;                  ///< one line, where failed or not possible
  std::vector<std::string> warnings;    ///< of a run done now
};

struct BenchmarkSequence {
  std::string name;
  FrameRange frames;
  std::optional<std::size_t> official_frames;  ///< of KITTI's sequence of that name
  bool is_complete = false;                    ///< these are all of KITTI's official frames
  bool has_ground_truth = false;
  std::vector<BenchmarkRun> runs;
  std::string problem;  ///< the sequence cannot be read
};

struct BenchmarkReport {
  std::string stemvo_version;
  std::vector<BenchmarkSequence> sequences;
  bool interrupted = false;
};
/// A sequence that cannot be read or a run that failed.
[[nodiscard]] bool has_failures(const BenchmarkReport& report);

/// Where the benchmark is. Frames are zero while a run starts.
struct BenchmarkProgress {
  std::string_view sequence;
  std::string_view configuration;
  ScaleProtocol protocol;
  std::size_t run = 0;  ///< 0, 1, ..
  std::size_t num_runs = 0;
  std::size_t frames_done = 0;
  std::size_t num_frames = 0;
  std::string_view note;  ///< why an earlier result does not count any more; may be empty
};
/// Called when a run starts and after each of its frames; false stops.
using BenchmarkCallback = std::function<bool(const BenchmarkProgress&)>;

/// Runs every sequence under every configuration and both protocols. OUT gets runs/NN/NAME_PROTOCOL
/// (all files of run_sequence), benchmark.md, benchmark.json (no times in either), speed.json and a
/// picture NN.png per sequence; they are written after each sequence and when stopped. A run whose
/// configuration, program, model, frames (names, sizes), calib, times and pose file are those of a
/// result in OUT is not repeated. A sequence or run that fails is a row with its reason.
/// Errors: no folder kitti_root/sequences, none in it, OUT cannot be written.
[[nodiscard]] Expected<BenchmarkReport> run_benchmark(const BenchmarkRequest& request,
                                                      const BenchmarkCallback& callback = {});

}  // namespace stemvo
