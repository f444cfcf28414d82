// SPDX-License-Identifier: MIT
#pragma once

#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "features/front_end.hpp"
#include "odometry/tracks.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/rigid3.hpp"

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

/// A homogeneous point in the camera; at infinity (w = 0) up to scale.
[[nodiscard]] inline Eigen::Vector3d in_camera(const Rigid3& camera_from_first,
                                               const Eigen::Vector4d& point) {
  return camera_from_first.rotation * point.head<3>() + point.w() * camera_from_first.translation;
}

/// Angle (rad) between neighbouring keyframes, summed up.
[[nodiscard]] double turned_rad(const std::vector<Rigid3>& camera_from_first);

/// A frame as the odometry left it.
struct TrackedFrame {
  cv::Mat gray;              ///< CV_8UC1
  Rigid3 world_from_camera;  ///< made with the given calibration
  bool is_measured = false;  ///< its motion from the frame before
  Matches matches;           ///< from the frame before, with track ids
  std::vector<char> is_inlier;
};

/// Cuts a drive into segments as its frames come. A segment begins at the keyframe that ended the
/// one before; a frame whose motion was not measured, or that shares too little, ends one. The
/// landmarks' observations are aligned anew with a patch from the middle of each track.
class SegmentBuilder {
 public:
  struct Keyframe {
    cv::Mat gray;
    Rigid3 world_from_camera;
    TrackPoints points;
  };

  explicit SegmentBuilder(const Camera& camera) : camera_(camera) {}

  void add(const TrackedFrame& frame);
  /// At the end of the drive: those that turn most (turns tell of the camera), in its order.
  [[nodiscard]] std::vector<Segment> complete();

 private:
  void close();

  Camera camera_;
  std::vector<Keyframe> open_;
  bool is_last_frame_open_ = false;  ///< the last frame given is the last keyframe
  std::vector<Segment> segments_;
};

}  // namespace stemvo::calibration
