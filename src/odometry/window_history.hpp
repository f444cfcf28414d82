// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include <opencv2/core.hpp>

#include "odometry/landmark_map.hpp"
#include "odometry/window.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// Motion from a keyframe to the next, or to a frame between them, as it was last refined.
struct WindowMotion {
  int prev = 0;  ///< frame numbers
  int cur = 0;
  Rigid3 prev_from_cur;
};

/// Keeps landmarks and motions that have left the window. Motions are kept, not poses: the window
/// is rescaled and moved as a whole later on, and what has left must not be torn from it. For the
/// same reason a landmark is kept in the camera of the last keyframe that saw it.
///
/// Lengths are those of the time when the frame came, give or take a few frames: the map's scale
/// drifts from frame to frame, and what puts the newest frames right would stretch the older ones,
/// which are right already.
class WindowHistory {
 public:
  /// The newest keyframe of the window saw this image (the input, gray or RGB).
  void observe(const Window& window, const cv::Mat& image);

  /// A keyframe is about to leave the window for the one that comes.
  void leave(const Window& window, std::size_t leaving, const Keyframe& coming);
  /// The window is rescaled. `is_first`: before, it had a scale of its own; then what is in it
  /// takes the new one.
  void rescale(const Window& window, double factor, bool is_first);
  /// The next frame, which began in 0, has its final pose.
  void end_frame() { scale_of_frame_.push_back(scale_); }
  /// The whole window is about to be dropped; nothing will connect with it.
  void close(const Window& window);

  /// Ordered by `cur`.
  [[nodiscard]] const std::vector<WindowMotion>& motions() const { return motions_; }
  /// Well-constrained landmarks that have left.
  [[nodiscard]] const std::vector<KeptLandmark>& landmarks() const { return landmarks_; }

 private:
  /// A track that the window sees.
  struct Track {
    int num_keyframes = 0;
    double max_parallax_rad = 0.0;
    std::array<std::uint8_t, 3> rgb{};
  };
  /// Units when the frame came, as the mean over its neighbours, per unit now; 1 of a frame that
  /// has not ended.
  [[nodiscard]] double units_of(int frame) const;
  void keep_motion(int prev, int cur, Rigid3 prev_from_cur);
  void keep(const Window& window, const Keyframe& last_seen_from, int track_id);
  void keep_motions(const Keyframe& prev, const Keyframe& cur);
  void keep_non_keyframes(const Keyframe& keyframe);

  std::vector<WindowMotion> motions_;
  std::vector<KeptLandmark> landmarks_;
  std::map<int, Track> tracks_;
  double scale_ = 1.0;  ///< of the window, by all that rescaled it
  std::vector<double> scale_of_frame_;
  int first_scaled_frame_ = 0;  ///< before it, lengths are in units of their own
};

/// Poses of all frames, with look-ahead: by their refined motion where there is one, else from the
/// frame before as they came. `motions` are ordered by `cur`; frame numbers count
/// `world_from_camera`, the poses as they came.
[[nodiscard]] std::vector<Rigid3> refined_poses(std::span<const Rigid3> world_from_camera,
                                                std::span<const WindowMotion> motions);

}  // namespace stemvo
