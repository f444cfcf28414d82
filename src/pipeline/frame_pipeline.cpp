// SPDX-License-Identifier: MIT
#include "pipeline/frame_pipeline.hpp"

#include <array>
#include <utility>

#include <opencv2/core/utility.hpp>

#include "odometry/frame_loops.hpp"
#include "timing/stage_timer.hpp"

namespace stemvo::pipeline {

void run_frames(const FrameSource& sequence, PhasedOdometry& odometry, const FrameVisitor& visit) {
  struct Slot {
    Expected<cv::Mat> pixels;
    Frame frame;
  };
  std::array<Slot, kMaxInFlight> ring;
  const auto slot_of = [&](std::size_t index) -> Slot& { return ring[index % kMaxInFlight]; };
  const FrameStages stages = {
      .read =
          [&](std::size_t index) {
            Slot& slot = slot_of(index);
            slot.frame = {};
            slot.pixels = timed(Stage::kRead, [&] { return sequence.read(index); });
            if (sequence.stream() && slot.pixels && slot.pixels->empty()) {
              return false;
            }
            slot.frame.time_s = sequence.time_s(index);
            return true;
          },
      .prepare =
          [&](std::size_t index) {
            if (Slot& slot = slot_of(index); slot.pixels) {
              slot.frame = odometry.prepare(*slot.pixels, slot.frame.time_s);
            }
          },
      .track = [&](std::size_t index) { odometry.track(std::move(slot_of(index).frame)); },
      .localize = [&](std::size_t) { odometry.localize(); },
      .optimize =
          [&](std::size_t index) {
            return visit(index, slot_of(index).pixels, odometry.optimize());
          }};
  run_frame_loops(stages, sequence.size(), cv::getNumThreads());
}

}  // namespace stemvo::pipeline
