// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "stemvo/camera.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// The fate of a frame. Every frame has a pose whatever its state.
enum class FrameState {
  kFirst,         ///< the world's origin
  kInitializing,  ///< no landmarks yet: the initial H/F selection waits for parallax, or decided
  kTracking,      ///< rotation and translation measured
  kStationary,    ///< no flow
  kLowParallax,   ///< hardly any parallax: the position owes much to the motion before
  kRotating,      ///< the same while the camera turns
  kGated,         ///< two_frame: the forward motion gate refused the motion
  kLost,          ///< nothing measured: the last motion is continued, and fades
  kNoImage,       ///< nothing to be seen: the same
};
[[nodiscard]] std::string_view to_string(FrameState state);
/// True except for kGated, kLost and kNoImage.
[[nodiscard]] bool is_measured(FrameState state);

/// Which two-view model a motion came from.
enum class TwoViewModel { kNone, kHomography, kEssential };

/// How a frame's scale was measured: by the road (`scale.source: camera_height`), or by speeds and
/// distances that were added.
enum class ScaleState {
  kDisabled,  ///< nobody measures it
  kNone,      ///< no road is believed: lengths are units, the scale is a guess
  kHeld,      ///< believed, not measured on this frame: the scale is kept, its sigma grows
  kMeasured,  ///< measured on this frame and believed
};
/// `disabled`, `none`, `held`, `measured`.
[[nodiscard]] std::string_view to_string(ScaleState state);

/// Standard deviations of a camera's estimate, to which the one in use goes step by step; of the
/// focal length, too, where only the principal point does.
struct CameraSigma {
  double fx_px = 0.0;  ///< that of fy is the same share of fy
  double cx_px = 0.0;
  double cy_px = 0.0;
};

/// Milliseconds per stage of one frame. Stages of different frames overlap: their sum is no frame's
/// time.
struct StageTimes {
  double stem_ms = 0.0;
  double features_ms = 0.0;
  double pose_ms = 0.0;
};

/// The pose of a frame and how it came about.
struct FrameResult {
  FrameState state = FrameState::kFirst;
  double time_s = 0.0;       ///< as given
  Rigid3 world_from_camera;  ///< of a path without jumps, but where a camera finds itself again
  /// The correction so far, by places that were recognized: where the frame is in the map is
  /// map_from_world * world_from_camera.
  Similarity3 map_from_world;
  bool is_measured = true;  ///< the motion since the last frame was, not guessed
  /// The map that holds the pose, counted from 0; before one begins, the one that is looked for. A
  /// camera that finds itself in an older map, or whose map is joined to one, has that one's; -1:
  /// that of another recording.
  int map_id = 0;
  bool is_scale_new = false;  ///< a map begins here: lengths before it had another unit
  int recognized_frame = -1;  ///< the frame whose place this one was recognized to show; -1: none
  /// The covariance of the motion from this frame to the last, prev_from_cur: the true motion is
  /// prev_from_cur * error. The error is x y z (the path's units, squared), then rotation about
  /// x y z (rad^2), all in this frame's camera axes. Where the path is in metres the scale's sigma
  /// is in it.
  Eigen::Matrix<double, 6, 6> motion_covariance = Eigen::Matrix<double, 6, 6>::Zero();
  int num_matches = 0;
  int num_inliers = 0;
  double homography_score = 0.0;   ///< S_H
  double fundamental_score = 0.0;  ///< S_F
  double homography_ratio = 0.0;   ///< R_H
  TwoViewModel model = TwoViewModel::kNone;
  ScaleState scale_state = ScaleState::kDisabled;
  std::string_view road_reason;  ///< why the road was not measured, else empty
  Camera camera;  ///< without distortion, with what was learnt so far (`camera.refine`)
  /// k1, k2 of a distortion that frames had nevertheless: pixels are freed of it.
  Eigen::Vector2d radial = Eigen::Vector2d::Zero();
  std::optional<CameraSigma> camera_sigma;  ///< nullopt: it is not refined
  std::optional<double> scale_sigma;        ///< of log(metres per unit); nullopt: nobody measures
  StageTimes times;
  std::string problem;  ///< why the stem gave no channel (the frame counts as no_image), else empty
};

/// A landmark of a window of keyframes, placed by the pose that the last of them to see it came
/// with.
struct MapLandmark {
  int id = 0;                                          ///< no other landmark's
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< in the world, in the trajectory's units
  std::array<std::uint8_t, 3> rgb{};  ///< of the last view; gray where the camera is gray
};

/// Changes of the map.
struct MapChanges {
  int version = 0;                     ///< to ask with the next time
  std::vector<MapLandmark> landmarks;  ///< added or moved
  std::vector<int> removed;            ///< ids, before that; maybe of some that were never given
};

/// A frame that landmarks were triangulated from.
struct MapKeyframe {
  int id = 0;     ///< counted from 0
  int frame = 0;  ///< results before this one's
  double time_s = 0.0;
  Rigid3 world_from_camera;  ///< as it came
};

/// A point of the image, tracked from an earlier frame.
struct TrackedPoint {
  int id = 0;                                         ///< the same while the point is tracked
  Eigen::Vector2d prev_uv = Eigen::Vector2d::Zero();  ///< input pixels
  Eigen::Vector2d uv = Eigen::Vector2d::Zero();
  bool is_inlier = false;
};

}  // namespace stemvo
