// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
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
  /// The newest keyframe of the window saw this image (the input, gray or RGB).
  void observe(const Window& window, const cv::Mat& image);

  /// A keyframe is about to leave the window for the one that comes.
  void leave(const Window& window, std::size_t leaving, const Keyframe& coming);
  /// The window is put into other units.
  void rescale(double factor) { scale_ *= factor; }
  /// The frame's pose is final: new keyframes have theirs in today's units.
  void end_frame(const Window& window);
  /// The whole window is about to be dropped.
  void close(const Window& window);

  /// Well-constrained landmarks that have left.
  [[nodiscard]] const std::vector<KeptLandmark>& landmarks() const { return landmarks_; }

 private:
  /// A track that the window sees.
  struct Track {
    int num_keyframes = 0;
    double max_parallax_rad = 0.0;
    std::array<std::uint8_t, 3> rgb{};
  };
  void keep(const Window& window, const Keyframe& last_seen_from, int track_id);

  std::vector<KeptLandmark> landmarks_;
  std::map<int, Track> tracks_;
  double scale_ = 1.0;                       ///< of the window, by all that rescaled it
  std::map<int, double> scale_of_keyframe_;  ///< when its pose went into the trajectory
};

}  // namespace stemvo
