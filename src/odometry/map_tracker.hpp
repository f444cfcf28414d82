// SPDX-License-Identifier: MIT
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "odometry/bundle_adjustment.hpp"
#include "odometry/local_map.hpp"
#include "odometry/map_history.hpp"
#include "odometry/map_placement.hpp"
#include "odometry/two_view_estimator.hpp"
#include "stemvo/features/front_end.hpp"
#include "stemvo/geometry/camera.hpp"
#include "stemvo/geometry/rigid3.hpp"

namespace stemvo {

struct MapTrackerOptions {
  LocalMapOptions map;
  BundleAdjustmentOptions refinement;
  PlacementOptions placement;
  bool use_landmarks = true;       ///< false: two-frame motions, each as long as the last step
  int refine_every = 1;            ///< keyframes between refinements, the paper's m; 0: never
  double first_step = 1.0;         ///< length of the first step, map units
  double epipolar_bound_px = 1.0;  ///< of the inliers of a motion that the map has corrected
};

/// Poses from a local map: each frame is placed against the landmarks, becomes a keyframe when it
/// has moved, and the window is refined. Lengths are in map units.
class MapTracker {
 public:
  MapTracker(const Camera& camera, const MapTrackerOptions& options);

  /// A frame whose matches start at the last one given (here or to restart), of pose
  /// `world_from_prev`. Numbers of frames grow. The two-frame motion brings inliers and a first
  /// guess; where it disagrees with the landmarks seen (or is lost), the frame is searched among
  /// them, and `motion` becomes what they say. Where the pose is not the one left here (the caller
  /// moved it) the map starts anew from it, as it does where the landmarks are out of view. Returns
  /// false where neither tells how the camera moved: `motion` is lost, nothing was added; to go on,
  /// `restart`.
  bool place(int frame,
             const Rigid3& world_from_prev,
             const Matches& matches,
             MeasuredMotion& motion);
  /// Second half, after place returned true for the same frame: it becomes a keyframe if it was
  /// tracked with parallax, and the window is refined; world_from_camera() changes with it.
  void extend(const Matches& matches, const MeasuredMotion& motion);
  /// False: a map was left behind, and the last frame's step is as long as the one before by guess;
  /// what was known of the unit no longer holds.
  [[nodiscard]] bool keeps_unit() const { return keeps_unit_; }
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
  /// By the two-frame motion and the length of the last step.
  [[nodiscard]] Rigid3 guess_pose(const MeasuredMotion& motion) const;
  /// By the landmarks; corrects the motion where they agree on another. nullopt: they do not tell.
  [[nodiscard]] std::optional<Rigid3> place_by_landmarks(const Matches& matches,
                                                         MeasuredMotion& motion) const;
  void correct_motion(const Rigid3& world_from_camera,
                      const Matches& matches,
                      MeasuredMotion& motion) const;
  /// Whether most matches are the motion's inliers.
  [[nodiscard]] bool is_agreed_on(const Matches& matches, const MeasuredMotion& motion) const;
  [[nodiscard]] bool is_believable(const Matches& matches, const MeasuredMotion& motion) const;
  void start_anew(bool is_last_pose_kept);
  void add_to_window(Keyframe keyframe);
  void open_map(const Matches& matches, const std::vector<char>& is_inlier);
  [[nodiscard]] bool is_new_keyframe(const MeasuredMotion& motion) const;

  Camera camera_;
  MapTrackerOptions options_;
  LocalMap map_;
  MapHistory history_;
  Rigid3 world_from_camera_;
  double last_step_;  ///< of a frame that was tracked
  bool keeps_unit_ = true;
  int frame_ = 0;  ///< the last one given
  int keyframes_since_refinement_ = 0;
};

}  // namespace stemvo
