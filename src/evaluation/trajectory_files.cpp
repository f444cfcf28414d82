// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <iterator>

#include <fmt/core.h>

#include "evaluation/trajectory.hpp"
#include "internal_check.hpp"
#include "text/text_file.hpp"

namespace stemvo {

namespace {

/// Entries of R^T R, or the length of a quaternion, may differ this much from the exact ones.
constexpr double kRotationTolerance = 1e-3;

/// Metres: further than any drive, and near enough that squares and sums stay finite.
constexpr double kFurthest_m = 1e9;

Expected<Rigid3> with_near_translation(const Rigid3& pose) {
  if (!(pose.translation.cwiseAbs().maxCoeff() <= kFurthest_m)) {
    return fail(fmt::format("expected a position within {} m, found ({}, {}, {})", kFurthest_m,
                            pose.translation.x(), pose.translation.y(), pose.translation.z()));
  }
  return pose;
}

Expected<Rigid3> pose_from_matrix_row(const std::vector<double>& numbers) {
  const Matrix34d matrix =
      Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>(numbers.data());
  const Eigen::Matrix3d rotation = matrix.leftCols<3>();
  const double deviation =
      (rotation.transpose() * rotation - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!(deviation <= kRotationTolerance)) {
    return fail(fmt::format(
        "expected a rotation in the first three columns, found R^T R off the identity by {:.3g}",
        deviation));
  }
  if (!(rotation.determinant() > 0.0)) {
    return fail("expected a rotation in the first three columns, found a reflection");
  }
  return with_near_translation(Rigid3::from_matrix(matrix));
}

Expected<Rigid3> pose_from_quaternion_row(const std::vector<double>& n) {
  const Eigen::Quaterniond rotation(n[7], n[4], n[5], n[6]);
  if (!(std::abs(rotation.norm() - 1.0) <= kRotationTolerance)) {
    return fail(
        fmt::format("expected a quaternion of length 1 in the last four numbers, found {:.6g}",
                    rotation.norm()));
  }
  return with_near_translation(Rigid3(rotation, Eigen::Vector3d(n[1], n[2], n[3])));
}

Error fail_empty(const std::filesystem::path& file) {
  return fail(fmt::format("{}: expected at least one pose, found none", file.string()));
}

}  // namespace

Expected<Trajectory> read_kitti_trajectory(const std::filesystem::path& file) {
  Expected<std::vector<std::string>> lines = read_lines(file);
  if (!lines) {
    return lines.error();
  }
  // Empty lines at the end of a file are no poses; within it they would shift the frame numbers.
  while (!lines->empty() && split_words(lines->back()).empty()) {
    lines->pop_back();
  }
  Trajectory poses;
  poses.reserve(lines->size());
  for (std::size_t i = 0; i < lines->size(); ++i) {
    const Expected<Rigid3> pose = parse_numbers((*lines)[i], 12).and_then(pose_from_matrix_row);
    if (!pose) {
      return fail_at(file, i, pose.error());
    }
    poses.push_back(*pose);
  }
  if (poses.empty()) {
    return fail_empty(file);
  }
  return poses;
}

Expected<TimedPose> parse_tum_row(std::string_view row) {
  return parse_numbers(row, 8).and_then([](const std::vector<double>& numbers) {
    return pose_from_quaternion_row(numbers).map(
        [&](const Rigid3& pose) { return TimedPose{numbers.front(), pose}; });
  });
}

Expected<TimedTrajectory> read_tum_trajectory(const std::filesystem::path& file) {
  const Expected<std::vector<std::string>> lines = read_lines(file);
  if (!lines) {
    return lines.error();
  }
  TimedTrajectory result;
  for (std::size_t i = 0; i < lines->size(); ++i) {
    const std::string line = (*lines)[i].substr(0, (*lines)[i].find('#'));
    if (split_words(line).empty()) {
      continue;
    }
    const Expected<TimedPose> row = parse_tum_row(line);
    if (!row) {
      return fail_at(file, i, row.error());
    }
    result.timestamps_s.push_back(row->time);
    result.world_from_camera.push_back(row->world_from_camera);
  }
  if (result.world_from_camera.empty()) {
    return fail_empty(file);
  }
  return result;
}

Status write_kitti_trajectory(const std::filesystem::path& file,
                              std::span<const Rigid3> world_from_camera) {
  std::string text;
  for (const Rigid3& pose : world_from_camera) {
    const Matrix34d matrix = pose.matrix();
    for (int i = 0; i < 12; ++i) {
      // + 0.0 turns -0 into 0.
      fmt::format_to(std::back_inserter(text), "{:.12e}{}", matrix(i / 4, i % 4) + 0.0,
                     i == 11 ? '\n' : ' ');
    }
  }
  return write_text_file(file, text);
}

Status write_tum_trajectory(const std::filesystem::path& file,
                            std::span<const double> timestamps_s,
                            std::span<const Rigid3> world_from_camera) {
  STEMVO_CHECK(timestamps_s.size() == world_from_camera.size(), "one timestamp per pose");
  std::string text;
  for (std::size_t i = 0; i < world_from_camera.size(); ++i) {
    const Eigen::Vector3d t = world_from_camera[i].translation.array() + 0.0;
    const Eigen::Array4d q = world_from_camera[i].rotation.coeffs().array() + 0.0;
    fmt::format_to(std::back_inserter(text),
                   "{:.9f} {:.12e} {:.12e} {:.12e} {:.12e} {:.12e} {:.12e} {:.12e}\n",
                   timestamps_s[i], t.x(), t.y(), t.z(), q[0], q[1], q[2], q[3]);
  }
  return write_text_file(file, text);
}

}  // namespace stemvo
