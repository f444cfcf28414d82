// SPDX-License-Identifier: MIT
#include "evaluation/trajectory.hpp"

#include <iterator>

#include <fmt/core.h>

#include "internal_check.hpp"
#include "text/text_file.hpp"

namespace stemvo {

namespace {

/// Shorter steps have no direction: what is left of them is rounding.
constexpr double kNoStep_m = 1e-9;

}  // namespace

Trajectory relative_to_first(std::span<const Rigid3> world_from_camera) {
  Trajectory moved;
  if (world_from_camera.empty()) {
    return moved;
  }
  moved.reserve(world_from_camera.size());
  const Rigid3 first_from_world = world_from_camera.front().inverse();
  for (const Rigid3& pose : world_from_camera) {
    moved.push_back(first_from_world * pose);
  }
  moved.front() = Rigid3();  // exactly
  return moved;
}

Eigen::Vector3d rescaled_step(std::span<const Rigid3> estimate,
                              std::span<const Rigid3> ground_truth,
                              std::size_t i) {
  const Eigen::Vector3d step = estimate[i].translation - estimate[i - 1].translation;
  const double true_length_m =
      (ground_truth[i].translation - ground_truth[i - 1].translation).norm();
  const double length_m = step.norm();
  return length_m > kNoStep_m ? Eigen::Vector3d(true_length_m / length_m * step)
                              : Eigen::Vector3d::Zero();
}

Trajectory rescale_steps(std::span<const Rigid3> estimate, std::span<const Rigid3> ground_truth) {
  STEMVO_CHECK(estimate.size() == ground_truth.size(), "one true pose per estimated pose");
  Trajectory rescaled(estimate.begin(), estimate.end());
  for (std::size_t i = 1; i < rescaled.size(); ++i) {
    rescaled[i].translation =
        rescaled[i - 1].translation + rescaled_step(estimate, ground_truth, i);
  }
  return rescaled;
}

std::string kitti_row(const Rigid3& world_from_camera) {
  const Matrix34d matrix = world_from_camera.matrix();
  std::string text;
  for (int i = 0; i < 12; ++i) {
    // + 0.0 turns -0 into 0.
    fmt::format_to(std::back_inserter(text), "{:.12e}{}", matrix(i / 4, i % 4) + 0.0,
                   i == 11 ? '\n' : ' ');
  }
  return text;
}

std::string tum_row(double timestamp_s, const Rigid3& world_from_camera) {
  const Eigen::Vector3d t = world_from_camera.translation.array() + 0.0;
  const Eigen::Array4d q = world_from_camera.rotation.coeffs().array() + 0.0;
  return fmt::format("{:.9f} {:.12e} {:.12e} {:.12e} {:.12e} {:.12e} {:.12e} {:.12e}\n",
                     timestamp_s, t.x(), t.y(), t.z(), q[0], q[1], q[2], q[3]);
}

Status write_kitti_trajectory(const std::filesystem::path& file,
                              std::span<const Rigid3> world_from_camera) {
  std::string text;
  for (const Rigid3& pose : world_from_camera) {
    text += kitti_row(pose);
  }
  return write_text_file(file, text);
}

Status write_tum_trajectory(const std::filesystem::path& file,
                            std::span<const double> timestamps_s,
                            std::span<const Rigid3> world_from_camera) {
  STEMVO_CHECK(timestamps_s.size() == world_from_camera.size(), "one timestamp per pose");
  std::string text;
  for (std::size_t i = 0; i < world_from_camera.size(); ++i) {
    text += tum_row(timestamps_s[i], world_from_camera[i]);
  }
  return write_text_file(file, text);
}

}  // namespace stemvo
