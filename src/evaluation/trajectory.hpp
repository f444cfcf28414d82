// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <span>
#include <vector>

#include "stemvo/error.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// Poses world_from_camera, one per frame; metres.
using Trajectory = std::vector<Rigid3>;

/// A line of a KITTI pose file, and of a TUM one.
[[nodiscard]] std::string kitti_row(const Rigid3& world_from_camera);
[[nodiscard]] std::string tum_row(double timestamp_s, const Rigid3& world_from_camera);
/// KITTI pose file: 12 numbers a line, row-major [R | t]. Errors name file and line: wrong count of
/// numbers, not a number, not finite, not a rotation (by more than 1e-3), empty file.
[[nodiscard]] Expected<Trajectory> read_kitti_trajectory(const std::filesystem::path& file);
/// At least 9 significant digits, single spaces, no trailing space.
[[nodiscard]] Status write_kitti_trajectory(const std::filesystem::path& file,
                                            std::span<const Rigid3> world_from_camera);
/// TUM: `t tx ty tz qx qy qz qw`, seconds; one timestamp per pose.
[[nodiscard]] Status write_tum_trajectory(const std::filesystem::path& file,
                                          std::span<const double> timestamps_s,
                                          std::span<const Rigid3> world_from_camera);

/// Moves all poses so that the first one is the identity.
[[nodiscard]] Trajectory relative_to_first(std::span<const Rigid3> world_from_camera);

/// The step to pose i > 0 in its own direction with the true step's length; zero where it is zero.
[[nodiscard]] Eigen::Vector3d rescaled_step(std::span<const Rigid3> estimate,
                                            std::span<const Rigid3> ground_truth,
                                            std::size_t i);
/// The paper's protocol: each step keeps its direction and takes the true step's length. A step of
/// length zero stays. Rotations are untouched. Both have the same length.
[[nodiscard]] Trajectory rescale_steps(std::span<const Rigid3> estimate,
                                       std::span<const Rigid3> ground_truth);

}  // namespace stemvo
