// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <mutex>
#include <utility>
#include <vector>

#include "timing/timing_report.hpp"

namespace stemvo {

/// What a frame goes through, in this order. Each is done at most once per frame.
enum class Stage {
  kRead,         ///< file and PNG decoder
  kStem,         ///< the filter
  kStretch,      ///< channel to 8-bit image
  kPyramid,      ///< klt
  kDescription,  ///< orb, sift: descriptors
  kRoadImage,
  kDetection,   ///< corners or keypoints
  kTracking,    ///< klt both ways, or matching of descriptors
  kHomography,  ///< robust estimate
  kEpipolar,    ///< fundamental or essential matrix, robust estimate
  kTwoViewRefinement,
  kLocalization,      ///< among the landmarks
  kWindowRefinement,  ///< triangulation and bundle adjustment
  kCamera,            ///< what a run of keyframes tells of it, beside the frames
  kRoadScale,
  kFrameFiles,   ///< frames.csv, images of frames
  kResultFiles,  ///< everything that is written at the end
};
inline constexpr int kNumStages = static_cast<int>(Stage::kResultFiles) + 1;

/// What becomes of a track from one frame to the next.
enum class TrackFate {
  kLookedFor,      ///< all of them; again, where the last good image is tried
  kOutOfView,      ///< its nearest neighbour's motion takes it out of the image
  kNotFound,       ///< the image is not like the patch
  kMerged,         ///< ran into an older one
  kOffEpipolar,    ///< a point that is no landmark yet, off its epipolar line
  kOffProjection,  ///< off the projection of its landmark
  kFoundAgain,     ///< looked for where the map has it: goes on, counted in the frame it ended in
};
inline constexpr int kNumFates = static_cast<int>(TrackFate::kFoundAgain) + 1;

/// Collects what StageTimers measure, in any thread, while it lives. One at a time (checked).
class StageRecorder {
 public:
  /// Processor time of the process until now is the report's row `start`.
  StageRecorder();
  ~StageRecorder();
  StageRecorder(const StageRecorder&) = delete;
  StageRecorder& operator=(const StageRecorder&) = delete;

  /// The living one, or null.
  [[nodiscard]] static StageRecorder* active() { return active_.load(std::memory_order_acquire); }

  void add(Stage stage, double wall_ms, double cpu_ms);
  /// A frame's result is there; `started`: when it was asked for.
  void add_frame(std::chrono::steady_clock::time_point started);
  void add_tracks(TrackFate fate, std::size_t count);
  void add_landmark(int num_keyframes);
  /// Processor time of all calls of a stage so far.
  [[nodiscard]] double cpu_ms(Stage stage) const;
  /// Of everything so far.
  [[nodiscard]] TimingReport report() const;

 private:
  struct Samples {
    std::vector<double> wall_ms;
    double cpu_ms = 0.0;
  };

  static std::atomic<StageRecorder*> active_;

  mutable std::mutex mutex_;
  double start_cpu_ms_;
  std::chrono::steady_clock::time_point start_;
  std::chrono::steady_clock::time_point last_frame_;
  std::vector<Samples> stages_;
  std::vector<double> intervals_ms_;
  std::vector<double> latencies_ms_;
  std::array<std::size_t, kNumFates> tracks_{};
  std::vector<int> landmarks_;
};

/// Counts tracks; without a StageRecorder it does nothing.
void count_tracks(TrackFate fate, std::size_t count);

/// A landmark that so many keyframes saw has left the window; the same.
void count_landmark(int num_keyframes);

/// Measures a stage from here to the end of the block; without a StageRecorder it does nothing. It
/// sees the calling thread only, not what OpenCV hands to other threads.
class StageTimer {
 public:
  explicit StageTimer(Stage stage);
  ~StageTimer();
  StageTimer(const StageTimer&) = delete;
  StageTimer& operator=(const StageTimer&) = delete;

 private:
  StageRecorder* recorder_;
  Stage stage_;
  std::chrono::steady_clock::time_point wall_;
  double cpu_ms_ = 0.0;
};

/// What `work` returns, measured.
template <typename Work>
decltype(auto) timed(Stage stage, Work&& work) {
  const StageTimer timer(stage);
  return std::forward<Work>(work)();
}

}  // namespace stemvo
