// SPDX-License-Identifier: MIT
#pragma once

#include <deque>
#include <string_view>

#include "odometry/road_dense.hpp"
#include "odometry/road_filter.hpp"
#include "odometry/road_path.hpp"
#include "odometry/road_picture.hpp"
#include "odometry/road_points.hpp"
#include "odometry/road_types.hpp"
#include "stemvo/geometry/camera.hpp"
#include "stemvo/geometry/rigid3.hpp"

namespace stemvo {

/// What is known of the scale after a frame; nothing of it looks ahead.
struct RoadScaleEstimate {
  double metres_per_unit = 1.0;  ///< metres = metres_per_unit * units of the given motions
  double sigma = 0.0;            ///< of log(metres_per_unit)
  bool is_initialized = false;   ///< a road was seen since the start (or since restart())
  bool is_measured = false;      ///< this frame's road was measured and believed
  RoadMeasurement dense;         ///< by direct alignment
  RoadMeasurement points;        ///< by tracked corners
  std::string_view reason = "";  ///< where is_measured is false
};

/// Metres per unit of a monocular odometry from the road: joins the estimators, and frames.
class RoadScale {
 public:
  RoadScale(const RoadOptions& options, const Camera& camera);

  /// One call per frame with a picture, made for this camera. `cur_from_prev`: the motion since the
  /// last call, in units of the map (ignored at the first call and after restart()).
  RoadScaleEstimate update(RoadPicture picture, const Rigid3& cur_from_prev);
  /// The map was multiplied by `factor` (new units = factor * old units).
  void rescale(double factor);
  /// Nothing connects the next frame with the ones before (lost, cut): units may be different ones.
  void restart();

 private:
  struct Past {
    RoadPicture picture;
    Rigid3 now_from_past;
  };
  /// The nearest past frame that is far enough away; nullptr where the car did not move.
  [[nodiscard]] const Past* pick_past() const;
  [[nodiscard]] RoadPrior make_prior(const Rigid3& motion) const;
  void remember(RoadPicture picture);
  /// Both estimators, joined and given to the filter.
  bool measure(const Past& past, const RoadPicture& picture, RoadScaleEstimate& result);

  RoadOptions options_;
  Camera camera_;
  RoadDense dense_;
  RoadPoints points_;
  RoadFilter filter_;
  RoadPath path_;
  std::deque<Past> past_;  ///< newest first
  int frames_unmeasured_ = 0;
};

}  // namespace stemvo
