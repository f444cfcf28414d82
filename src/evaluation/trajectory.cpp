// SPDX-License-Identifier: MIT
#include "evaluation/trajectory.hpp"

#include "internal_check.hpp"

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

Trajectory rescale_steps(std::span<const Rigid3> estimate, std::span<const Rigid3> ground_truth) {
  STEMVO_CHECK(estimate.size() == ground_truth.size(), "one true pose per estimated pose");
  Trajectory rescaled(estimate.begin(), estimate.end());
  for (std::size_t i = 1; i < rescaled.size(); ++i) {
    const Eigen::Vector3d step = estimate[i].translation - estimate[i - 1].translation;
    const double true_length_m =
        (ground_truth[i].translation - ground_truth[i - 1].translation).norm();
    const double length_m = step.norm();
    rescaled[i].translation = rescaled[i - 1].translation;
    if (length_m > kNoStep_m) {
      rescaled[i].translation += true_length_m / length_m * step;
    }
  }
  return rescaled;
}

}  // namespace stemvo
