// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "features/front_end.hpp"
#include "geometry/bundle.hpp"
#include "odometry/road/image.hpp"
#include "stemvo/frame_result.hpp"
#include "stemvo/odometry.hpp"
#include "stemvo/options.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// A frame on its way: prepared, tracked, localized, optimized. Without an image it stands for one
/// that could not be read, or not be seen through the channel.
struct Frame {
  [[nodiscard]] bool has_image() const { return !image.empty(); }

  int number = 0;  ///< counted from 0, frames without an image among them
  double time_s = 0.0;
  FrameHints hints;
  cv::Mat image;  ///< as given, gray or RGB: where landmarks get their colour
  std::shared_ptr<const ImagePyramid> pyramid;  ///< of the channel: where points are tracked
  std::shared_ptr<const RoadImage> road;        ///< null: the road is not asked
  Matches matches;                              ///< none on the first image
  StageTimes times;
  std::string problem;  ///< why the stem gave no channel, else empty
};

/// A frame whose pose may still be refined.
struct LocalizedFrame {
  FrameResult result;             ///< all but the pose, and the road measurement
  std::vector<char> inlier_mask;  ///< one per match: it agrees with the motion
  Observations projections;       ///< of the landmarks without an inlier in this frame
};

/// A landmark in the camera of the last keyframe that saw it, in the units of its pose in the
/// trajectory.
struct KeptLandmark {
  int frame = 0;  ///< of the keyframe
  Eigen::Vector3f in_camera = Eigen::Vector3f::Zero();
  std::array<std::uint8_t, 3> rgb{};
};

/// Tracks in, poses out; the front end follows tracks to the next frame while a frame is optimized.
/// Frames come in order, each through both halves.
class Estimator {
 public:
  virtual ~Estimator() = default;

  /// First half: state and inliers.
  [[nodiscard]] virtual LocalizedFrame localize(const Frame& frame) = 0;
  /// Second half, the slower one: completes the result with pose and scale.
  virtual void optimize(const Frame& frame, LocalizedFrame& localized) = 0;

  /// One pose per frame so far, world_from_camera, as they came.
  [[nodiscard]] virtual const std::vector<Rigid3>& trajectory() const = 0;
  /// The camera as it was learnt, relative to the given one. nullopt: nothing is learnt.
  [[nodiscard]] virtual std::optional<CameraEstimate> camera_estimate() const {
    return std::nullopt;
  }
  /// The landmarks of Odometry::landmarks(), to be placed by the trajectory; none where there is no
  /// window.
  [[nodiscard]] virtual std::vector<KeptLandmark> landmarks() const { return {}; }
};

/// Length of a step that nothing measures: one unit where no scale is asked for.
[[nodiscard]] inline double assumed_step(const ScaleOptions& scale) {
  return scale.source == ScaleSource::kNone ? 1.0 : scale.step_m;
}

/// An equal share of a motion that took several frames.
[[nodiscard]] inline Rigid3 motion_of_one_frame(const Rigid3& motion, int num_frames) {
  return {so3_exp(so3_log(motion.rotation) / num_frames), motion.translation / num_frames};
}

}  // namespace stemvo
