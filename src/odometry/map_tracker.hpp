// SPDX-License-Identifier: MIT
#pragma once

#include <vector>

#include <Eigen/Core>

#include "odometry/bundle_adjustment.hpp"
#include "odometry/local_map.hpp"
#include "odometry/map_history.hpp"
#include "odometry/two_view_estimator.hpp"
#include "stemvo/features/front_end.hpp"
#include "stemvo/geometry/absolute_pose.hpp"
#include "stemvo/geometry/camera.hpp"
#include "stemvo/geometry/rigid3.hpp"

namespace stemvo {

struct MapTrackerOptions {
  LocalMapOptions map;
  BundleAdjustmentOptions refinement;
  AbsolutePoseOptions pose;
  int refine_every = 1;     ///< keyframes between refinements, the paper's m; 0: never
  int min_landmarks = 30;   ///< fewer in view: the two-frame motion is taken as it is
  double first_step = 1.0;  ///< length of the first step, map units
};

/// Poses from a local map: each frame is placed against the landmarks, becomes a keyframe when it
/// has moved, and the window is refined. Lengths are in map units.
class MapTracker {
 public:
  MapTracker(const Camera& camera, const MapTrackerOptions& options);

  /// A frame whose matches start at the last one given (here or to restart), of pose
  /// `world_from_prev`. Numbers of frames grow. The two-frame motion brings inliers and a first
  /// guess. Where the pose is not the one left here (the frames between were lost, or the caller
  /// moved it) the map starts anew from it.
  void add(int frame,
           const Rigid3& world_from_prev,
           const Matches& matches,
           const MeasuredMotion& motion);
  /// Nothing connects this frame with the ones before; the next matches start at it.
  void restart(int frame);

  [[nodiscard]] const Rigid3& world_from_camera() const { return world_from_camera_; }
  [[nodiscard]] const LocalMap& map() const { return map_; }
  void keep_landmarks() { history_.keep_landmarks(); }
  /// The input picture of the last frame, for the landmarks' colours.
  void look(const cv::Mat& picture);
  /// What has left the window, and the window as it stands now.
  [[nodiscard]] MapHistory history() const;
  /// Multiplies every length; `center` (in the world) stays where it is.
  void rescale(double factor, const Eigen::Vector3d& center);

 private:
  [[nodiscard]] Rigid3 place(const Matches& matches, const MeasuredMotion& motion);
  void start_anew(bool is_last_pose_kept);
  void add_to_window(Keyframe keyframe);
  void open_map(const Matches& matches, const std::vector<char>& is_inlier);
  [[nodiscard]] bool is_new_keyframe(const MeasuredMotion& motion) const;
  void extend_map(const Matches& matches, const std::vector<char>& is_inlier);

  Camera camera_;
  MapTrackerOptions options_;
  LocalMap map_;
  MapHistory history_;
  Rigid3 world_from_camera_;
  double last_step_;
  int frame_ = 0;  ///< the last one given
  int keyframes_since_refinement_ = 0;
};

}  // namespace stemvo
