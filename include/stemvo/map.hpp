// SPDX-License-Identifier: MIT
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "stemvo/camera.hpp"
#include "stemvo/frame_result.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// A place that was seen again. Frames are counted from 0; those of a map that was loaded from -2
/// down.
struct MapLoop {
  int from_frame = 0;  ///< the earlier one
  int to_frame = 0;
};

/// A keyframe, adjusted.
struct AdjustedKeyframe {
  int frame = 0;  ///< results before this one's
  double time_s = 0.0;
  Rigid3 map_from_camera;
  /// Where it was asked for and could be found: the true map_from_camera is this one * error, which
  /// is x y z (the path's units, squared), then rotation about x y z (rad^2), in the camera's axes,
  /// with the first keyframe held.
  std::optional<Eigen::Matrix<double, 6, 6>> covariance = std::nullopt;
};

/// All that was seen, adjusted at once: what a recording says when it is over. The map has the axes
/// and the units of the world where the first keyframe was, or those of the map that was loaded.
struct AdjustedMap {
  std::vector<Rigid3> map_from_camera;  ///< one per frame
  std::vector<AdjustedKeyframe> keyframes;
  std::vector<MapLandmark> landmarks;  ///< those of Odometry::landmarks_since(0), in the map
  std::vector<MapLoop> loops;
  Camera camera;                            ///< as all frames together tell it
  std::optional<CameraSigma> camera_sigma;  ///< nullopt: it is not refined (`camera.refine`)
};

}  // namespace stemvo
