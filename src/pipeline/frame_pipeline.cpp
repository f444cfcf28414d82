// SPDX-License-Identifier: MIT
#include "pipeline/frame_pipeline.hpp"

#include <atomic>
#include <memory>
#include <optional>
#include <utility>

#include <tbb/parallel_pipeline.h>

namespace stemvo::pipeline {
namespace {

/// Frames between the reader and the pose: enough that no stage waits for another's slow frame.
constexpr std::size_t kMaxInFlight = 4;

struct Frame {
  std::size_t index = 0;
  Expected<cv::Mat> pixels;
  PreparedFrame prepared;
};
using FramePtr = std::shared_ptr<Frame>;  // TBB copies what stages hand on

}  // namespace

void run_frames(const KittiSequence& sequence, Odometry& odometry, const FrameVisitor& visit) {
  std::size_t num_started = 0;
  std::atomic<bool> is_over = false;
  const auto start = [&](tbb::flow_control& control) {
    if (is_over || num_started == sequence.size()) {
      control.stop();
      return FramePtr();
    }
    auto frame = std::make_shared<Frame>();
    frame->index = num_started++;
    return frame;
  };
  const auto read = [&](const FramePtr& frame) {
    frame->pixels = sequence.read(frame->index);
    return frame;
  };
  const auto prepare = [&](const FramePtr& frame) {
    if (frame->pixels) {
      frame->prepared = odometry.prepare(*frame->pixels);
    }
    return frame;
  };
  FramePtr before;  // whose result the next call brings
  const auto hand_over = [&](const std::optional<FrameResult>& result) {
    if (result && before) {
      is_over = !visit(before->index, before->pixels, *result);
    }
  };
  const auto push = [&](const FramePtr& frame) {
    if (!is_over) {
      hand_over(odometry.push(std::move(frame->prepared)));
      before = frame;
    }
  };

  using tbb::filter_mode;
  tbb::parallel_pipeline(
      kMaxInFlight,
      tbb::make_filter<void, FramePtr>(filter_mode::serial_in_order, start) &
          tbb::make_filter<FramePtr, FramePtr>(filter_mode::parallel, read) &
          tbb::make_filter<FramePtr, FramePtr>(filter_mode::serial_in_order, prepare) &
          tbb::make_filter<FramePtr, void>(filter_mode::serial_in_order, push));
  if (!is_over) {
    hand_over(odometry.finish());
  }
}

}  // namespace stemvo::pipeline
