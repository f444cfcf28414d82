// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "stemvo/rigid3.hpp"

namespace stemvo {

/// A landmark in the camera of the last keyframe that saw it.
struct KeptLandmark {
  int frame = 0;  ///< of the keyframe
  Eigen::Vector3f in_camera = Eigen::Vector3f::Zero();
  std::array<std::uint8_t, 3> rgb{};
};

/// Landmarks and the poses that place them: the window's look-ahead moved the two together, so the
/// poses of the trajectory, which had none, would tear the landmarks apart.
struct LandmarkMap {
  std::vector<KeptLandmark> landmarks;
  std::vector<Rigid3> world_from_camera;  ///< of every frame
};

}  // namespace stemvo
