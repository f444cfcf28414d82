// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <deque>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "geometry/bundle.hpp"
#include "odometry/tracks.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// A frame that stays in the window.
struct Keyframe {
  int frame = 0;
  Rigid3 world_from_camera;
  Observations points;
};

/// Keyframes of one view and the landmarks they see, connected by track ids. Everything is in units
/// of the map; the owner says what one is in metres.
struct Window {
  std::deque<Keyframe> keyframes;            ///< oldest first
  std::map<int, Eigen::Vector3d> landmarks;  ///< track id -> point in the world
  std::set<int> fixed;  ///< track ids of landmarks that were known before: no adjustment moves them
};

struct WindowOptions {
  int num_keyframes = 8;  ///< length of the window
  /// Parallax of a new landmark between its first and last keyframe: only the direction of distant
  /// ones is known, but that holds the rotation.
  double min_parallax_deg = 0.1;
  double min_way_deg = 0.25;  ///< of the known landmarks (median) between the same two keyframes
  double max_reprojection_error_px = 4.0;  ///< of a landmark in any keyframe
};

/// A keyframe's view of a track.
struct KeyframeObservation {
  std::size_t keyframe;  ///< its place in the window
  Eigen::Vector2d uv;
};

/// Looks tracks up in all keyframes of a window, in the order of their ids: every keyframe's points
/// are walked over once.
class ObservationWalk {
 public:
  explicit ObservationWalk(const Window& window) : window_(window) {
    for (const Keyframe& keyframe : window.keyframes) {
      next_.push_back(keyframe.points.begin());
    }
  }
  /// Oldest keyframe first; valid until the next call, whose id is higher.
  [[nodiscard]] std::span<const KeyframeObservation> seek(int track_id) {
    found_.clear();
    for (std::size_t i = 0; i < next_.size(); ++i) {
      const Observations& points = window_.keyframes[i].points;
      while (next_[i] != points.end() && next_[i]->track_id < track_id) {
        ++next_[i];
      }
      if (next_[i] != points.end() && next_[i]->track_id == track_id) {
        found_.push_back({i, next_[i]->uv});
      }
    }
    return found_;
  }

 private:
  const Window& window_;
  std::vector<Observations::const_iterator> next_;  ///< of each keyframe
  std::vector<KeyframeObservation> found_;
};

/// camera_from_world of the keyframes.
[[nodiscard]] std::vector<Rigid3> poses_of(const Window& window);

/// A landmark is where the camera sees it: in front of it and within `bound_px` of `uv`.
[[nodiscard]] inline bool is_near(const Rigid3& camera_from_world,
                                  const Eigen::Vector3d& point_in_world,
                                  const Eigen::Vector2d& uv,
                                  const Camera& camera,
                                  double bound_px) {
  const Eigen::Vector3d point = camera_from_world * point_in_world;
  return point.z() > 0.0 && (camera.project(point) - uv).norm() <= bound_px;
}

/// The angle under which a point sees two cameras.
[[nodiscard]] double parallax_rad(const Eigen::Vector3d& point_in_world,
                                  const Rigid3& world_from_a,
                                  const Rigid3& world_from_b);

/// The keyframe that leaves a full window for the one that comes: the oldest once the two share too
/// few tracks to hold each other, else the one that adds the least between its neighbours. So the
/// window is as long a way as one view lasts, whether the camera drives or is held in the hand.
/// (One of less than 5 keyframes always drops the oldest.)
[[nodiscard]] std::size_t leaving_keyframe(const Window& window, const Keyframe& coming);

/// Tracks of the leaving keyframe that neither another one nor the coming one sees.
[[nodiscard]] std::vector<int> lost_tracks(const Window& window,
                                           std::size_t leaving,
                                           const Keyframe& coming);

/// Drops a keyframe for the one that comes, and landmarks that no keyframe sees any more.
void drop_keyframe(Window& window, std::size_t leaving, const Keyframe& coming);

/// Triangulates the tracks of the newest keyframe that are no landmarks yet, from the first and the
/// last keyframe that see them. Kept are points with enough parallax, in front of every keyframe
/// that sees them and reprojected well in each.
void triangulate_landmarks(Window& window, const Camera& camera, const WindowOptions& options);

/// Drops landmarks that a keyframe sees from behind or too far from their observation.
void cull_landmarks(Window& window, const Camera& camera, const WindowOptions& options);

void drop_landmarks(Window& window, std::span<const int> track_ids);

/// Puts landmarks, by track id, where they are known to be in the world, and fixes them there. Left
/// out are those that no keyframe sees, or one sees farther off than `bound_px`; and all where
/// those are the most: window and map disagree.
void fix_landmarks(Window& window,
                   const Camera& camera,
                   const std::map<int, Eigen::Vector3d>& known,
                   double bound_px);

/// Moves everything, lengths too; `moved`: new world from old.
void move(Window& window, const Similarity3& moved);

/// Multiplies every length; `center` (in the world) stays where it is.
void rescale(Window& window, double factor, const Eigen::Vector3d& center);

/// Sliding-window bundle adjustment: poses of the window and its landmarks, robust reprojection
/// error, Schur complement over the landmarks. Two fixed keyframes (the oldest ones) hold the
/// gauge, scale included; with one the length of the window is kept, from the oldest keyframe to
/// the last but one. The loss scale is the options' or twice the median error, whichever is larger.
/// One thread: the same bytes on every run. False: too little to do, or not solved; the window is
/// unchanged.
bool refine_window(Window& window, const Camera& camera, const BundleOptions& options);

/// The camera as a window tells it, all else left free.
struct CameraMeasurement {
  IntrinsicsDelta change;         ///< of `camera`
  CameraInformation information;  ///< of it alone, without the prior
};
[[nodiscard]] std::optional<CameraMeasurement> measure_camera(const Window& window,
                                                              const Camera& camera,
                                                              const CameraPrior& prior,
                                                              const BundleOptions& options);

}  // namespace stemvo
