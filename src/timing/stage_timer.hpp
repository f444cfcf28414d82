// SPDX-License-Identifier: MIT
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

namespace stemvo {

/// A frame goes through these, in this order; most are done at most once per frame.
enum class Stage {
  kRead,         ///< file and PNG decoder
  kStem,         ///< the filter
  kContrast,     ///< channel to 8-bit image
  kPyramid,      ///< patch, klt
  kDescription,  ///< orb, sift: descriptors
  kRoadImage,
  kDetection,   ///< corners or keypoints
  kTracking,    ///< patches, klt both ways, or matching of descriptors
  kHomography,  ///< robust estimate
  kEpipolar,    ///< fundamental or essential matrix, robust estimate
  kTwoViewRefinement,
  kLocalization,      ///< among the landmarks
  kWindowRefinement,  ///< triangulation and bundle adjustment
  kCamera,            ///< what a run of keyframes tells of it, beside the frames
  kRoadScale,
  kPlaces,       ///< described and looked up, beside the frames
  kPoseGraph,    ///< of the map that remembers, beside the frames
  kFrameFiles,   ///< frames.csv, images of frames
  kResultFiles,  ///< everything that is written at the end
};
inline constexpr int kNumStages = static_cast<int>(Stage::kResultFiles) + 1;

struct StageTiming {
  std::string name;
  std::size_t calls = 0;
  double median_ms = 0.0;  ///< wall time of one call
  double p95_ms = 0.0;     ///< 95 of 100 calls take no longer
  double cpu_s = 0.0;      ///< of the calling thread, all calls
};

struct TimingReport {
  std::vector<StageTiming> stages;  ///< in the order a frame meets them; those never called: not
  double rest_cpu_s = 0.0;          ///< start of the program, no stage, OpenCV's other threads
  double cpu_s = 0.0;               ///< processor time of the whole program
  double fps = 0.0;                 ///< frames over wall time, process start to trajectory written
  std::size_t num_frames = 0;
  int num_threads = 0;
  double peak_memory_mib = 0.0;  ///< most the program has held at once; NaN: not told
};

/// Collects what StageTimers measure, in any thread. One at a time (checked).
class StageRecorder {
 public:
  StageRecorder();
  ~StageRecorder() { active_.store(nullptr, std::memory_order_release); }
  StageRecorder(const StageRecorder&) = delete;
  StageRecorder& operator=(const StageRecorder&) = delete;

  [[nodiscard]] static StageRecorder* active() { return active_.load(std::memory_order_acquire); }

  void add(Stage stage, double wall_ms, double cpu_ms);
  /// Covers everything so far; `fps`, `num_frames` and `num_threads` are the caller's to fill in.
  [[nodiscard]] TimingReport report() const;

 private:
  struct Samples {
    std::vector<double> wall_ms;
    double cpu_ms = 0.0;
  };

  static std::atomic<StageRecorder*> active_;

  mutable std::mutex mutex_;
  std::vector<Samples> stages_;
};

/// Measures a stage from here to the end of the block, in the calling thread only; without a
/// StageRecorder it does nothing.
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

template <typename Work>
decltype(auto) timed(Stage stage, Work&& work) {
  const StageTimer timer(stage);
  return std::forward<Work>(work)();
}

}  // namespace stemvo
