// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "features/front_end.hpp"
#include "geometry/bundle.hpp"
#include "geometry/pose_influence.hpp"
#include "geometry/radial_lens.hpp"
#include "mapping/kept_map.hpp"
#include "odometry/road/image.hpp"
#include "odometry/way.hpp"
#include "stemvo/frame_result.hpp"
#include "stemvo/odometry.hpp"
#include "stemvo/options.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// A frame on its way: prepared, tracked, localized, optimized. Without an image it stands for one
/// that could not be read, or not be seen through the channel.
struct Frame {
  [[nodiscard]] bool has_image() const { return !image.empty(); }

  int number = 0;             ///< counted from 0, frames without an image among them
  double time_s = 0.0;        ///< as given; once it is tracked: since the first frame (FrameClock)
  double given_time_s = 0.0;  ///< once it is tracked
  FrameHints hints;
  std::vector<Way> ways;  ///< that came before this frame did
  cv::Mat image;          ///< as given, gray or RGB: where landmarks get their colour
  std::shared_ptr<ImagePyramid> pyramid;  ///< of the channel: where points are tracked
  std::shared_ptr<const RoadImage> road;  ///< null: the road is not asked
  Matches matches;                        ///< none on the first image
  /// prev_from_cur from the last image, by the whole of both (ImageTurn). nullopt: not known.
  std::optional<Eigen::Quaterniond> image_turn = std::nullopt;
  StageTimes times;
  std::string problem;  ///< why the stem gave no channel, else empty
};

/// A frame whose pose may still be refined.
struct LocalizedFrame {
  FrameResult result;             ///< all but the pose, and the road measurement
  std::vector<char> inlier_mask;  ///< one per match: it agrees with the motion
  std::vector<char> moving_mask;  ///< one per match, or none: it moves on its own, no inlier
  Observations projections;       ///< of the landmarks without an inlier in this frame
  bool may_be_hidden = false;     ///< these are, behind what passes a camera that stands
  /// Motions that two views tell: MeasuredMotion::covariance of what is added to the pose before.
  std::optional<Matrix6d> two_view = std::nullopt;
};

/// One per match: its track goes on.
[[nodiscard]] inline std::vector<char> kept_tracks(const LocalizedFrame& localized) {
  std::vector<char> kept = localized.inlier_mask;
  for (std::size_t i = 0; i < localized.moving_mask.size(); ++i) {
    kept[i] = kept[i] != 0 || localized.moving_mask[i] != 0 ? 1 : 0;
  }
  return kept;
}

/// A landmark in the camera of the last keyframe that saw it, in the units of its pose in the
/// trajectory.
struct KeptLandmark {
  int id = 0;
  int frame = 0;  ///< of the keyframe
  Eigen::Vector3f in_camera = Eigen::Vector3f::Zero();
  std::array<std::uint8_t, 3> rgb{};
};

/// Whether hints of the rotation since the last frame are to be believed where nothing is measured:
/// once the last few that could be compared were right.
class HintTrust {
 public:
  void compare(const FrameHints& hints, const Eigen::Quaterniond& measured_prev_from_cur) {
    constexpr double kMaxOff_rad = 0.02;  // of one that is right, by timing and noise ..
    constexpr double kMaxShare = 0.2;     // .. and this share of the rotation
    if (hints.prev_from_cur) {
      const double angle = Eigen::Quaterniond::Identity().angularDistance(measured_prev_from_cur);
      const bool is_right = hints.prev_from_cur->angularDistance(measured_prev_from_cur) <
                            kMaxOff_rad + kMaxShare * angle;
      num_right_ = is_right ? std::min(num_right_ + 1, kFew) : 0;
    }
  }
  [[nodiscard]] std::optional<Eigen::Quaterniond> trusted(const FrameHints& hints) const {
    return num_right_ == kFew ? hints.prev_from_cur : std::nullopt;
  }

 private:
  static constexpr int kFew = 5;
  int num_right_ = 0;  ///< in a row, at most so many
};

/// MapChanges, to be placed by the trajectory.
struct LandmarkChanges {
  int version = 0;
  std::vector<KeptLandmark> landmarks;
  std::vector<int> removed;
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
  [[nodiscard]] const std::vector<Rigid3>& trajectory() const { return trajectory_; }
  /// The camera as it was learnt, relative to the given one. nullopt: nothing is learnt.
  [[nodiscard]] virtual std::optional<CameraEstimate> camera_estimate() const {
    return std::nullopt;
  }
  /// The next frames' pixels are freed of this.
  [[nodiscard]] virtual RadialLens lens() const { return {}; }
  /// As Odometry::landmarks_since; none where there is no window.
  [[nodiscard]] virtual LandmarkChanges landmarks_since(int /*version*/) const { return {}; }
  /// The map that is remembered, the keyframes of the window among it; nothing where there is no
  /// window or loops are off.
  [[nodiscard]] virtual KeptMap kept_map() const { return {}; }
  /// Before the first frame: what an earlier recording remembered may be recognized.
  virtual void load_map(KeptMap /*map*/) {}  // NOLINT: an override keeps it
  /// Numbers of the frames that are keyframes or were, in order.
  [[nodiscard]] virtual std::span<const int> keyframes() const { return {}; }

 protected:
  std::vector<Rigid3> trajectory_;
  std::vector<double> times_s_;  ///< of the frames so far, the one in work among them
};

/// Length of a step that nothing measures: one unit where no scale is asked for. A drive's first
/// interval makes a speed of it.
[[nodiscard]] inline double assumed_step(const ScaleOptions& scale) {
  return scale.source == ScaleSource::kNone ? 1.0 : scale.step_m;
}

}  // namespace stemvo
