// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "stemvo/geometry/rigid3.hpp"

namespace stemvo::calibration {

/// A pixel that sees a landmark from one keyframe of the segment.
struct Observation {
  int keyframe = 0;
  Eigen::Vector2d uv = Eigen::Vector2d::Zero();  ///< input pixels
};

/// A homogeneous point (x, y, z, w) of length 1 in the first keyframe's camera: distant ones, w
/// near 0, are as good as near ones.
struct Landmark {
  Eigen::Vector4d point = Eigen::Vector4d::UnitZ();
  std::vector<Observation> observations;  ///< ordered by keyframe
};

/// A stretch of the drive that shares nothing with the others but the camera.
struct Segment {
  std::vector<Rigid3> camera_from_first;  ///< per keyframe, the first the identity
  std::vector<Landmark> landmarks;
};

/// Into the camera of a keyframe; at infinity (w = 0) up to scale.
[[nodiscard]] inline Eigen::Vector3d in_keyframe(const Segment& segment,
                                                 int keyframe,
                                                 const Eigen::Vector4d& point) {
  const Rigid3& pose = segment.camera_from_first[static_cast<std::size_t>(keyframe)];
  return pose.rotation * point.head<3>() + point.w() * pose.translation;
}

/// Sum over its keyframes of the angle between neighbours.
[[nodiscard]] double turned_rad(const Segment& segment);

/// Leaves the segments that turn most, in the order of the drive: turns tell of the camera.
void keep_turns(std::vector<Segment>& segments, std::size_t max_segments);

}  // namespace stemvo::calibration
