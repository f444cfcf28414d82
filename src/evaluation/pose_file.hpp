// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <vector>

#include "evaluation/trajectory.hpp"
#include "stemvo/error.hpp"

namespace stemvo {

/// Poses of a file of any format that is known, in the order of their times.
struct PoseFile {
  std::vector<double> timestamps_s = {};  ///< empty: KITTI's, one pose per frame
  Trajectory poses = {};
  std::filesystem::path file;
  bool is_of_body = false;  ///< EuRoC's: world_from_body in place of world_from_camera
};

/// The first row that is no comment tells the format: EuRoC's has commas (`time in ns, x, y, z, qw,
/// qx, qy, qz, ..`), TUM's eight numbers (`time in s, x, y, z, qx, qy, qz, qw`), KITTI's twelve.
/// Errors: file and line: a wrong count of numbers, not a number, not finite, not a rotation,
/// nothing in it.
[[nodiscard]] Expected<PoseFile> read_pose_file(const std::filesystem::path& file);

/// How far apart in time a frame and its true pose may be: half the time between two poses of a
/// slow motion capture (50 Hz), and what evo takes too. Nothing is interpolated: at usual speeds a
/// nearest pose is millimetres off, and errors are those that other programs find.
inline constexpr double kTimeTolerance_s = 0.01;

/// Pairs of times: `first[k]` of the one list goes with `second[k]` of the other. Both increase.
struct TimePairs {
  std::vector<std::size_t> first;
  std::vector<std::size_t> second;
};
/// Each is the nearest of the other, and not farther than the tolerance. Both lists are in order.
[[nodiscard]] TimePairs pair_by_time(std::span<const double> first_s,
                                     std::span<const double> second_s,
                                     double tolerance_s);

/// The poses of the indices, in their order.
[[nodiscard]] Trajectory take_poses(std::span<const Rigid3> poses,
                                    std::span<const std::size_t> indices);

}  // namespace stemvo
