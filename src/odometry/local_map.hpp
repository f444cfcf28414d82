// SPDX-License-Identifier: MIT
#pragma once

#include <deque>
#include <map>
#include <vector>

#include <Eigen/Core>

#include "stemvo/geometry/rigid3.hpp"

namespace stemvo {

/// A track seen in a keyframe.
struct MapObservation {
  int track_id = -1;
  Eigen::Vector2d uv = Eigen::Vector2d::Zero();  ///< input pixels
};

/// A frame that stays in the window.
struct Keyframe {
  int frame = 0;
  Rigid3 world_from_camera;
  std::vector<MapObservation> observations;  ///< ordered by track id
};

/// Keyframes of the last stretch of road and the landmarks they see, connected by track ids.
/// Everything is in map units; the owner says what one is in metres.
struct LocalMap {
  std::deque<Keyframe> keyframes;            ///< oldest first
  std::map<int, Eigen::Vector3d> landmarks;  ///< track id -> point in the world

  void clear() {
    keyframes.clear();
    landmarks.clear();
  }
};

struct LocalMapOptions {
  int num_keyframes = 8;  ///< length of the window
  /// Of a new landmark, between its first and last keyframe: only the direction of distant ones is
  /// known, but that holds the rotation.
  double min_parallax_deg = 0.1;
  double max_reprojection_error_px = 1.5;  ///< of a landmark in any keyframe
};

/// The keyframe's observation of a track, or nullptr.
[[nodiscard]] const MapObservation* find_observation(const Keyframe& keyframe, int track_id);

/// Adds a keyframe; the oldest leaves a full window, and landmarks no keyframe sees go with it.
void add_keyframe(LocalMap& map, Keyframe keyframe, const LocalMapOptions& options);

}  // namespace stemvo
