// SPDX-License-Identifier: MIT
#include "pipeline/frame_pipeline.hpp"

#include <array>
#include <chrono>
#include <utility>

#include <opencv2/core/utility.hpp>

#include "models/manifest.hpp"
#include "pipeline/frame_scheduler.hpp"
#include "timing/stage_timer.hpp"

namespace stemvo::pipeline {

Expected<PhasedOdometry> create_odometry(const Config& config,
                                         const Camera& camera,
                                         const std::filesystem::path& models_dir,
                                         const cv::Mat& mask) {
  Options options = config;
  auto stem = with_network(config.stem, models_dir);
  if (!stem) {
    return stem.error();
  }
  options.stem = *std::move(stem);
  return PhasedOdometry::create(camera, options, mask);
}

namespace {

/// A frame that the odometry tracked in an earlier run. False: the run ends behind it.
bool finish_tracked(const FrameSource& sequence, PhasedOdometry& odometry, const FrameRun& run) {
  const std::size_t frame = *run.tracked;
  if (sequence.stream()) {  // each is read once, in order
    for (std::size_t i = 0; i < frame; ++i) {
      static_cast<void>(sequence.read(i));
    }
  }
  const Expected<cv::Mat> pixels = sequence.read(frame);
  odometry.localize();
  return run.visit(frame, pixels, odometry.optimize());
}

}  // namespace

void run_frames(const FrameSource& sequence, PhasedOdometry& odometry, const FrameRun& run) {
  if (run.tracked && !finish_tracked(sequence, odometry, run)) {
    return;
  }
  const std::size_t first = run.tracked ? *run.tracked + 1 : 0;
  struct Frame {
    std::chrono::steady_clock::time_point started;
    Expected<cv::Mat> pixels;
    PreparedFrame prepared;
  };
  std::array<Frame, kMaxInFlight> ring;
  const auto frame_at = [&](std::size_t index) -> Frame& { return ring[index % kMaxInFlight]; };
  bool is_stopped = false;  // set and read by stages that wait for each other
  const FrameStages stages = {
      .read =
          [&](std::size_t index) {
            Frame& frame = frame_at(index);
            frame.started = std::chrono::steady_clock::now();
            frame.prepared = {};
            frame.pixels = timed(Stage::kRead, [&] { return sequence.read(first + index); });
            return !sequence.stream() || !frame.pixels || !frame.pixels->empty();
          },
      .prepare =
          [&](std::size_t index) {
            if (Frame& frame = frame_at(index); frame.pixels) {
              frame.prepared = odometry.prepare(*frame.pixels);
            }
          },
      .track =
          [&](std::size_t index) {
            if (!is_stopped) {
              odometry.track(std::move(frame_at(index).prepared));
            }
          },
      .localize =
          [&](std::size_t index) {
            is_stopped = run.may_localize && !run.may_localize(first + index);
            if (!is_stopped) {
              odometry.localize();
            }
          },
      .optimize =
          [&](std::size_t index) {
            if (is_stopped) {
              return false;
            }
            const bool goes_on =
                run.visit(first + index, frame_at(index).pixels, odometry.optimize());
            if (StageRecorder* recorder = StageRecorder::active()) {
              recorder->add_frame(frame_at(index).started);
            }
            return goes_on;
          }};
  run_stages(stages, sequence.size() - first, cv::getNumThreads());
}

}  // namespace stemvo::pipeline
