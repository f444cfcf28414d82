// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "dataset/frame_source.hpp"
#include "evaluation/pose_file.hpp"
#include "stemvo/error.hpp"

namespace stemvo::dataset {

/// The camera's poses, also of EuRoC's file, whose poses are the body's: T_BS of the camera file
/// says how the camera sits on it; without one, of ../cam0/sensor.yaml. Errors: those of
/// read_pose_file; EuRoC's without T_BS.
[[nodiscard]] Expected<PoseFile> read_truth(
    const std::filesystem::path& file, const std::optional<std::filesystem::path>& camera_file);

/// Error: fewer than two pairs, which the spans of time may explain. `owner`: of the times.
[[nodiscard]] Status check_pairs(const std::filesystem::path& truth_file,
                                 std::span<const double> truth_s,
                                 const std::string& owner,
                                 std::span<const double> times_s,
                                 const TimePairs& pairs,
                                 double tolerance_s);

/// The poses that frames have: by their times where the file has times, else one per frame, from
/// pose `begin` on. Errors: fewer than two of these times; fewer poses than frames.
[[nodiscard]] Expected<GroundTruth> match_frames(const PoseFile& truth,
                                                 const std::filesystem::path& truth_file,
                                                 std::size_t begin,
                                                 const std::vector<double>& times_s,
                                                 double tolerance_s);

}  // namespace stemvo::dataset
