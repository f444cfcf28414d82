// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include <opencv2/core.hpp>

#include "odometry/estimator.hpp"
#include "odometry/window.hpp"

namespace stemvo {

/// Keeps landmarks that have left the window, each in the camera of the last keyframe that saw it.
/// The trajectory's pose of that frame places it, however the window was moved or rescaled since.
/// Lengths are in the units of that pose: what puts the newest frames right would stretch the older
/// ones, which are right already.
class WindowHistory {
 public:
  /// The newest keyframe of the window, which is adjusted to it, saw this image (the input, gray or
  /// RGB).
  void observe(const Window& window, const cv::Mat& image);

  /// A keyframe is about to leave the window for the one that comes.
  void leave(const Window& window, std::size_t leaving, const Keyframe& coming) {
    for (const int track_id : lost_tracks(window, leaving, coming)) {
      keep(window, window.keyframes[leaving], track_id);
    }
    scale_of_keyframe_.erase(window.keyframes[leaving].frame);
  }
  /// The window is put into other units.
  void rescale(double factor) {
    scale_ *= factor;
    window_moved();
  }
  void window_moved() { window_moved_at_ = now(); }
  /// The window's unit in that of a keyframe's pose in the trajectory; a keyframe of the window
  /// whose frame has ended.
  [[nodiscard]] double units(int frame) const { return scale_of_keyframe_.at(frame) / scale_; }
  /// The frame's pose is final: new keyframes have theirs in today's units.
  void end_frame(const Window& window) {
    ++num_frames_;
    for (const Keyframe& keyframe : window.keyframes) {
      add_keyframe(keyframe.frame);
    }
  }
  /// A frame that has ended is a keyframe, too; its pose is in today's units.
  void add_keyframe(int frame) {
    const bool is_new = scale_of_keyframe_.try_emplace(frame, scale_).second;
    // A new map may begin at a keyframe of the one before.
    if (is_new && (keyframes_.empty() || frame > keyframes_.back())) {
      keyframes_.push_back(frame);
    }
  }
  /// The whole window is about to be dropped.
  void close(const Window& window) {
    for (auto keyframe = window.keyframes.rbegin(); keyframe != window.keyframes.rend();
         ++keyframe) {
      for (const Observation& observation : keyframe->points) {
        keep(window, *keyframe, observation.track_id);
      }
    }
    tracks_.clear();
    scale_of_keyframe_.clear();
  }

  /// Changes of well-constrained landmarks, those that have left and those of the window. A version
  /// is a number of frames that have ended.
  [[nodiscard]] LandmarkChanges changes_since(int version, const Window& window) const;
  /// Numbers of the frames that were keyframes, in order.
  [[nodiscard]] std::span<const int> keyframes() const { return keyframes_; }

 private:
  /// A track that the window sees.
  struct Track {
    int id = 0;  ///< of the landmark: a track may come again when its landmark has left
    int num_keyframes = 0;
    double max_parallax_rad = 0.0;
    std::array<std::uint8_t, 3> rgb{};
    bool is_shown = false;  ///< among the window's landmarks
  };
  template <typename T>
  struct Change {
    int version = 0;
    T what;
  };
  /// The version that holds what happens now.
  [[nodiscard]] int now() const { return num_frames_ + 1; }
  [[nodiscard]] KeptLandmark place(const Track& track,
                                   const Keyframe& last_seen_from,
                                   const Eigen::Vector3d& point) const;
  void keep(const Window& window, const Keyframe& last_seen_from, int track_id) {
    const auto track = tracks_.find(track_id);
    if (track == tracks_.end()) {
      return;
    }
    if (track->second.is_shown) {
      left_.push_back({now(), place(track->second, last_seen_from, window.landmarks.at(track_id))});
    }
    tracks_.erase(track);
  }

  std::vector<Change<KeptLandmark>> left_;  ///< only added to
  std::vector<Change<int>> removed_;        ///< ids; only added to
  std::vector<int> keyframes_;
  int num_frames_ = 0;
  int num_landmarks_ = 0;    ///< ids given
  int window_moved_at_ = 0;  ///< version
  std::map<int, Track> tracks_;
  double scale_ = 1.0;                       ///< of the window, by all that rescaled it
  std::map<int, double> scale_of_keyframe_;  ///< when its pose went into the trajectory
};

}  // namespace stemvo
