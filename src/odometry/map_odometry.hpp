// SPDX-License-Identifier: MIT
#pragma once

#include <optional>
#include <string_view>

#include "odometry/map_tracker.hpp"
#include "odometry/road_scale.hpp"
#include "odometry/two_view_estimator.hpp"
#include "stemvo/config.hpp"
#include "stemvo/features/front_end.hpp"
#include "stemvo/geometry/camera.hpp"
#include "stemvo/odometry/odometry.hpp"

namespace stemvo {

/// The map behind the two-frame motions: places each frame against landmarks, refines the window,
/// and, with `scale.source: camera_height`, keeps the map in metres by what the road tells.
class MapOdometry {
 public:
  MapOdometry(const Config& config, const Camera& camera);

  /// The first picture, or one whose motion was not measured: nothing connects it with the past.
  void restart(int frame, const RoadPicture& road);
  /// First half, a frame with matches from the last one given here, of pose `world_from_prev`: its
  /// place among the landmarks. Afterwards the inliers of `motion` are final.
  void place(int frame,
             const Rigid3& world_from_prev,
             const Matches& matches,
             MeasuredMotion& motion);
  /// Second half, the same frame, the slower one: refines the map and asks the road. Gives the
  /// motion what they add: R and direction of T refined, and the length of the step.
  void refine(const RoadPicture& road, const Matches& matches, MeasuredMotion& motion);
  void keep_landmarks() { tracker_.keep_landmarks(); }
  /// The input picture of the last frame given to refine, for the landmarks' colours.
  void look(const cv::Mat& picture) { tracker_.look(picture); }
  /// Keyframe motions and landmarks as they were last refined.
  [[nodiscard]] MapHistory history() const { return tracker_.history(); }
  /// Of log(metres per map unit), after the last frame; nullopt where the road is not asked.
  [[nodiscard]] std::optional<double> scale_sigma() const { return scale_sigma_; }
  /// What the road told of the last frame given.
  [[nodiscard]] RoadState road_state() const { return road_state_; }
  [[nodiscard]] std::string_view road_reason() const { return road_reason_; }

 private:
  /// Asks the road, and keeps what it says of the frame.
  RoadScaleEstimate ask_road(const RoadPicture& road, const Rigid3& cur_from_prev);
  /// Multiplies the map so that one unit is a metre; `center` stays.
  void make_metric(const RoadPicture& road,
                   const Rigid3& cur_from_prev,
                   const Eigen::Vector3d& center);

  MapTracker tracker_;
  Rigid3 world_from_prev_;  ///< of the last frame given to place
  int frame_ = 0;           ///< the same
  bool is_placed_ = false;  ///< the same
  std::optional<RoadScale> road_;
  std::optional<double> scale_sigma_;
  RoadState road_state_ = RoadState::kNotAsked;
  std::string_view road_reason_;
};

}  // namespace stemvo
