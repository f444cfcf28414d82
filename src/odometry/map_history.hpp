// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include <opencv2/core.hpp>

#include "odometry/local_map.hpp"
#include "stemvo/geometry/rigid3.hpp"
#include "stemvo/odometry/odometry.hpp"

namespace stemvo {

/// Motion between two keyframes as it was last refined.
struct KeyframeMotion {
  int prev = 0;  ///< frame numbers
  int cur = 0;
  Rigid3 prev_from_cur;
};

/// What the window leaves behind. Motions between neighbours are kept, not poses: the window is
/// rescaled and moved as a whole later on, and what has left must not be torn from it. For the same
/// reason a landmark is kept in the camera of the last keyframe that saw it.
class MapHistory {
 public:
  /// From now on landmarks are kept too.
  void keep_landmarks() { keeps_landmarks_ = true; }
  /// The newest keyframe of the window sees this picture (the input, gray or RGB).
  void look(const LocalMap& map, const cv::Mat& picture);

  /// The oldest keyframe is about to leave the window for the one that comes.
  void leave(const LocalMap& map, const Keyframe& coming);
  /// The whole window is about to be dropped; nothing will connect with it.
  void close(const LocalMap& map);

  [[nodiscard]] const std::vector<KeyframeMotion>& motions() const { return motions_; }
  /// Well-constrained landmarks that have left.
  [[nodiscard]] const std::vector<MapLandmark>& landmarks() const { return landmarks_; }

 private:
  /// What is known of a track that the window sees.
  struct Track {
    int num_keyframes = 0;
    double max_parallax_rad = 0.0;
    std::array<std::uint8_t, 3> rgb{};
  };
  void keep(const LocalMap& map, const Keyframe& last_seen_from, int track_id);

  bool keeps_landmarks_ = false;
  std::vector<KeyframeMotion> motions_;
  std::vector<MapLandmark> landmarks_;
  std::map<int, Track> tracks_;
};

/// Poses of all frames, with look-ahead: a keyframe follows its predecessor by their refined
/// motion, any other frame the one before it as it did when it came. `motions` are ordered by
/// `cur`; frame numbers count `world_from_camera`, the poses as they came.
[[nodiscard]] std::vector<Rigid3> refined_poses(std::span<const Rigid3> world_from_camera,
                                                std::span<const KeyframeMotion> motions);

}  // namespace stemvo
