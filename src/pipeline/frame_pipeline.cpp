// SPDX-License-Identifier: MIT
#include "pipeline/frame_pipeline.hpp"

#include <array>
#include <chrono>
#include <utility>

#include <opencv2/core/utility.hpp>

#include "internal_check.hpp"
#include "models/manifest.hpp"
#include "pipeline/frame_scheduler.hpp"
#include "timing/stage_timer.hpp"

namespace stemvo::pipeline {
namespace {

struct Frame {
  std::size_t index = 0;
  std::chrono::steady_clock::time_point started;
  Expected<cv::Mat> pixels;
  PreparedFrame prepared;
};

/// The stages of an odometry, on frames that go round kMaxInFlight places.
class OdometryStages {
 public:
  OdometryStages(const FrameSource& sequence, PhasedOdometry& odometry, const FrameVisitor& visit)
      : sequence_(sequence), odometry_(odometry), visit_(visit) {}

  [[nodiscard]] FrameStages stages() {
    return {.read = [this](std::size_t index) { read(index); },
            .prepare = [this](std::size_t index) { prepare(index); },
            .track = [this](std::size_t index) { track(index); },
            .localize = [this](std::size_t index) { localize(index); },
            .optimize = [this](std::size_t index) { return optimize(index); }};
  }

 private:
  void read(std::size_t index) {
    Frame& frame = ring_[index % kMaxInFlight];
    frame.index = index;
    frame.started = std::chrono::steady_clock::now();
    frame.prepared = {};
    frame.pixels = timed(Stage::kRead, [&] { return sequence_.read(index); });
  }
  void prepare(std::size_t index) {
    Frame& frame = next(num_prepared_, index);
    if (frame.pixels) {
      frame.prepared = odometry_.prepare(*frame.pixels);
    }
  }
  void track(std::size_t index) { odometry_.track(std::move(next(num_tracked_, index).prepared)); }
  void localize(std::size_t index) {
    next(num_localized_, index);
    odometry_.localize();
  }
  bool optimize(std::size_t index) {
    const Frame& frame = next(num_optimized_, index);
    const FrameResult result = odometry_.optimize();
    const bool goes_on = visit_(index, frame.pixels, result);
    if (StageRecorder* recorder = StageRecorder::active()) {
      recorder->add_frame(frame.started);
    }
    return goes_on;
  }

  /// The frame that a stage is given must be the one after its last.
  Frame& next(std::size_t& num_given, std::size_t index) {
    Frame& frame = ring_[index % kMaxInFlight];
    STEMVO_CHECK(index == num_given && frame.index == index, "a stage gets the frames in order");
    ++num_given;
    return frame;
  }

  const FrameSource& sequence_;
  PhasedOdometry& odometry_;
  const FrameVisitor& visit_;
  std::array<Frame, kMaxInFlight> ring_;
  std::size_t num_prepared_ = 0;
  std::size_t num_tracked_ = 0;
  std::size_t num_localized_ = 0;
  std::size_t num_optimized_ = 0;
};

}  // namespace

Expected<PhasedOdometry> create_odometry(const Config& config,
                                         const Camera& camera,
                                         const std::filesystem::path& models_dir) {
  Options options = config;
  auto stem = with_network(config.stem, models_dir);
  if (!stem) {
    return stem.error();
  }
  options.stem = *std::move(stem);
  return PhasedOdometry::create(camera, options);
}

void run_frames(const FrameSource& sequence, PhasedOdometry& odometry, const FrameVisitor& visit) {
  OdometryStages odometry_stages(sequence, odometry, visit);
  run_stages(odometry_stages.stages(), sequence.size(), cv::getNumThreads());
}

}  // namespace stemvo::pipeline
