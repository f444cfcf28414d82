// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include <nlohmann/json.hpp>

#include "dataset/frame_source.hpp"
#include "pipeline/run.hpp"
#include "stemvo/error.hpp"

/// Whether an earlier run's result counts: it stands beside the hashes of what it came from.
namespace stemvo::benchmark {

inline constexpr const char* kInputsFile = "benchmark_inputs.json";  // of a run that is done
inline constexpr const char* kMetricsFile = "metrics.json";
inline constexpr const char* kPosesFile = "trajectory_kitti.txt";

/// Hashes of everything a result depends on.
[[nodiscard]] Expected<nlohmann::ordered_json> hash_inputs(const RunRequest& run,
                                                           const FrameSource& sequence);
/// Why the run of this folder is to be done (again), for its title; nothing where its result
/// counts.
[[nodiscard]] std::optional<std::string> reason_to_run(const std::filesystem::path& folder,
                                                       const nlohmann::ordered_json& inputs);
/// The run in this folder is done, and may be kept.
[[nodiscard]] Status keep_run(const std::filesystem::path& folder,
                              const nlohmann::ordered_json& inputs);

}  // namespace stemvo::benchmark
