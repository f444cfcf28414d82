// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "geometry/bundle.hpp"
#include "mapping/kept_map.hpp"
#include "mapping/map_tracks.hpp"
#include "stemvo/camera.hpp"

namespace stemvo {

struct MapAdjustmentOptions {
  Camera camera;  ///< as it is known beforehand; without distortion
  /// Standard deviations of its cx, cy (px), focal length (share), k1, k2 as they are known
  /// beforehand; nullopt: the camera stays.
  std::optional<IntrinsicsDelta> camera_sigma;
  /// So many keyframes at the beginning are another recording's: their own camera is theirs.
  int num_of_other_camera = 0;
  std::vector<int> covariance_of;  ///< keyframes
  /// Most views of a track, which then counts as one observation; 0: all, each counts, and the
  /// longest tracks are taken: they tell a camera best. The path is told better, and ten times as
  /// fast, by pieces of any tracks.
  std::size_t max_views = 0;
  /// False: neither the camera's nor the keyframes' are asked for. They take half of the memory.
  bool has_sigmas = true;
};

/// A landmark, and who sees it.
struct AdjustedLandmark {
  Eigen::Vector3d in_map = Eigen::Vector3d::Zero();
  MapTrack views;
};

struct MapAdjustment {
  std::vector<Similarity3> map_from_keyframe;
  std::vector<AdjustedLandmark> landmarks;
  /// Mean and sigma of the options' camera.
  CameraEstimate camera;
  /// Covariances of the keyframes asked for: the true map_from_camera is the adjusted one * error.
  /// The error is x y z (units of the map, squared), then rotation about x y z (rad^2), in the
  /// camera's axes, with keyframe 0 held.
  std::vector<Eigen::Matrix<double, 6, 6>> covariances;
  double median_error_px = 0.0;
};

/// Bundle adjustment of a whole map from where its graph is: all keyframes, the landmarks of their
/// corners and the camera. Keyframes that few landmarks connect hold together by their motions and
/// loops. Keyframe 0 stays; the scale is that of the map's lengths, else the graph's. Reprojection
/// errors are under Cauchy's loss. One thread: the same bytes on every run. nullopt: fewer than two
/// keyframes, no landmarks, or not solved.
[[nodiscard]] std::optional<MapAdjustment> adjust_map(const KeptMap& map,
                                                      const MapAdjustmentOptions& options);

}  // namespace stemvo
