// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <vector>

#include "internal_check.hpp"
#include "stemvo/error.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// Poses world_from_camera, one per frame; metres.
using Trajectory = std::vector<Rigid3>;

/// Estimated poses and the true ones of the same frames: as many (checked).
struct PosePairs {
  PosePairs(std::span<const Rigid3> estimated, std::span<const Rigid3> ground_truth)
      : estimate(estimated), truth(ground_truth) {
    STEMVO_CHECK(estimate.size() == truth.size(), "one true pose per estimated pose");
  }
  [[nodiscard]] std::size_t size() const { return truth.size(); }

  std::span<const Rigid3> estimate;
  std::span<const Rigid3> truth;
};

/// [R | t] of 12 numbers, row by row, or of the first of more. Error: R is no rotation.
[[nodiscard]] Expected<Rigid3> pose_from_rows(const std::vector<double>& numbers);

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

/// Moves all poses so that the frame's, or the first one, is the identity.
[[nodiscard]] Trajectory relative_to(std::size_t frame, std::span<const Rigid3> world_from_camera);
[[nodiscard]] Trajectory relative_to_first(std::span<const Rigid3> world_from_camera);

/// The step to pose i > 0 in its own direction with the true step's length; zero where it is zero.
[[nodiscard]] Eigen::Vector3d rescaled_step(std::span<const Rigid3> estimate,
                                            std::span<const Rigid3> ground_truth,
                                            std::size_t i);
/// The paper's protocol: each step keeps its direction and takes the true step's length. A step of
/// length zero stays. Rotations are untouched.
[[nodiscard]] Trajectory rescale_steps(const PosePairs& pairs);

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

[[nodiscard]] Trajectory take_poses(std::span<const Rigid3> poses,
                                    std::span<const std::size_t> indices);

}  // namespace stemvo
