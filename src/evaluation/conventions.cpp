// SPDX-License-Identifier: MIT
#include "evaluation/conventions.hpp"

#include <algorithm>
#include <numeric>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "evaluation/metrics.hpp"

namespace stemvo {
namespace {

constexpr double kDoubtful_percent = 50.0;  ///< errors of no odometry, of motions of any unit
constexpr double kFits = 0.2;               ///< of the error as given: it is the other convention

/// Mean error of motions over an eighth of the path, after the lengths were made alike.
double motion_error_percent(Trajectory estimate, std::span<const Rigid3> ground_truth) {
  constexpr std::size_t kMaxSegments = 500;
  const double scale = length_of_path(ground_truth) / length_of_path(estimate);
  for (Rigid3& pose : estimate) {
    pose.translation *= scale;
  }
  const std::vector<double> errors = dense_errors(estimate, ground_truth, kMaxSegments).t_percent;
  return std::accumulate(errors.begin(), errors.end(), 0.0) / static_cast<double>(errors.size());
}

Rigid3 with_w_first(const Rigid3& pose) {
  const Eigen::Vector4d read = pose.rotation.coeffs();
  return {Eigen::Quaterniond(read[0], read[1], read[2], read[3]), pose.translation};
}

/// The camera's motion of that of axes turned against it.
Rigid3 with_axes(const Rigid3& pose, const Eigen::Quaterniond& axes_from_camera) {
  const Rigid3 turn(axes_from_camera, Eigen::Vector3d::Zero());
  return turn.inverse() * pose * turn;
}

}  // namespace

std::optional<std::string> other_convention(std::span<const Rigid3> estimate,
                                            std::span<const Rigid3> ground_truth) {
  const Eigen::Quaterniond robot_from_camera(0.5, -0.5, 0.5, -0.5);
  const Eigen::Quaterniond opengl_from_camera(0.0, 1.0, 0.0, 0.0);
  const double given_percent = motion_error_percent(relative_to_first(estimate), ground_truth);
  if (!(given_percent > kDoubtful_percent)) {
    return std::nullopt;
  }
  const auto error_percent = [&](const auto& convert) {
    Trajectory poses(estimate.begin(), estimate.end());
    std::ranges::transform(poses, poses.begin(), convert);
    return motion_error_percent(std::move(poses), ground_truth);
  };
  const std::pair<const char*, double> others[] = {
      {"camera_from_world, the inverse of world_from_camera",
       error_percent([](const Rigid3& pose) { return pose.inverse(); })},
      {"quaternions with w first", error_percent(with_w_first)},
      {"of axes x forward, y left, z up",
       error_percent([&](const Rigid3& pose) { return with_axes(pose, robot_from_camera); })},
      {"of axes x right, y up, z backward",
       error_percent([&](const Rigid3& pose) { return with_axes(pose, opengl_from_camera); })}};
  const auto& [name, percent] =
      *std::ranges::min_element(others, {}, [](const auto& other) { return other.second; });
  if (!(percent < kFits * given_percent)) {
    return std::nullopt;
  }
  return fmt::format("the poses seem to be {}: motions would be off by {:.2g} % for {:.2g} %", name,
                     percent, given_percent);
}

}  // namespace stemvo
