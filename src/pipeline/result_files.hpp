// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <optional>
#include <span>

#include "config/config.hpp"
#include "dataset/frame_source.hpp"
#include "evaluation/trajectory.hpp"
#include "pipeline/run.hpp"
#include "stemvo/error.hpp"

namespace stemvo::pipeline {

/// trajectory_kitti.txt and trajectory_tum.txt. Poses of the first frames of the sequence.
[[nodiscard]] Status write_trajectories(const std::filesystem::path& out_dir,
                                        const FrameSource& sequence,
                                        std::span<const Rigid3> trajectory);

/// trajectory_refined_kitti.txt; without one, what an earlier run left there is removed.
[[nodiscard]] Status write_refined_trajectory(const std::filesystem::path& out_dir,
                                              const std::optional<Trajectory>& refined);

/// map.ply: the landmarks and the camera's path in the world of trajectory_refined_kitti.txt.
/// `refined` are the poses the landmarks belong to, `written` the same in the file: where steps
/// were rescaled, landmarks are with them.
[[nodiscard]] Status write_point_map(const std::filesystem::path& out_dir,
                                     std::span<const MapLandmark> landmarks,
                                     std::span<const Rigid3> refined,
                                     std::span<const Rigid3> written);

/// config.yaml: the effective configuration under comments that say which program, frames and model
/// made the results. `stemvo run --config` takes it as it is.
[[nodiscard]] Status write_config(const std::filesystem::path& out_dir,
                                  const Config& config,
                                  const FrameSource& sequence,
                                  const StemInfo& stem);

/// trajectory.png and .svg, against the ground truth where there is one.
[[nodiscard]] Status write_map(const std::filesystem::path& out_dir,
                               const FrameSource& sequence,
                               std::span<const Rigid3> trajectory,
                               const MetricsReport& report);

}  // namespace stemvo::pipeline
