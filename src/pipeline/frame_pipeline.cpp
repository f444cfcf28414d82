// SPDX-License-Identifier: MIT
#include "pipeline/frame_pipeline.hpp"

#include <array>
#include <utility>

#include <opencv2/core/utility.hpp>

#include "odometry/frame_loops.hpp"
#include "timing/stage_timer.hpp"

namespace stemvo::pipeline {

Expected<PhasedOdometry> create_odometry(const Config& config,
                                         const Camera& camera,
                                         const cv::Mat& mask) {
  return PhasedOdometry::create(camera, config, mask);
}

void run_frames(const FrameSource& sequence, PhasedOdometry& odometry, const FrameVisitor& visit) {
  struct Frame {
    Expected<cv::Mat> pixels;
    stemvo::Frame prepared;
  };
  std::array<Frame, kMaxInFlight> ring;
  const auto frame_at = [&](std::size_t index) -> Frame& { return ring[index % kMaxInFlight]; };
  const FrameStages stages = {
      .read =
          [&](std::size_t index) {
            Frame& frame = frame_at(index);
            frame.prepared = {};
            frame.pixels = timed(Stage::kRead, [&] { return sequence.read(index); });
            return !sequence.stream() || !frame.pixels || !frame.pixels->empty();
          },
      .prepare =
          [&](std::size_t index) {
            if (Frame& frame = frame_at(index); frame.pixels) {
              frame.prepared = odometry.prepare(*frame.pixels);
            }
          },
      .track = [&](std::size_t index) { odometry.track(std::move(frame_at(index).prepared)); },
      .localize = [&](std::size_t) { odometry.localize(); },
      .optimize =
          [&](std::size_t index) {
            return visit(index, frame_at(index).pixels, odometry.optimize());
          }};
  run_frame_loops(stages, sequence.size(), cv::getNumThreads());
}

}  // namespace stemvo::pipeline
