// SPDX-License-Identifier: MIT
#include "pipeline/frame_pipeline.hpp"

#include <atomic>
#include <chrono>
#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>

#include <tbb/parallel_pipeline.h>

#include "timing/stage_timer.hpp"

namespace stemvo::pipeline {
namespace {

/// Frames between the reader and the pose: enough that no stage waits for another's slow frame.
constexpr std::size_t kMaxInFlight = 4;

struct Frame {
  std::size_t index = 0;
  std::chrono::steady_clock::time_point started;
  Expected<cv::Mat> pixels;
  PreparedFrame prepared;
};
using FramePtr = std::shared_ptr<Frame>;  // TBB copies what stages hand on

/// Ends the run at the first exception of a stage. TBB itself must see none: a pipeline that it
/// cancels never frees the frames on their way.
class Guard {
 public:
  [[nodiscard]] bool is_over() const { return is_over_; }
  void end() { is_over_ = true; }
  template <typename Work>
  void run(const Work& work) {
    if (is_over_) {
      return;
    }
    try {
      work();
    } catch (...) {
      const std::lock_guard lock(mutex_);
      first_ = first_ == nullptr ? std::current_exception() : first_;
      is_over_ = true;
    }
  }
  void rethrow() const {
    if (first_ != nullptr) {
      std::rethrow_exception(first_);
    }
  }

 private:
  std::atomic<bool> is_over_ = false;
  std::mutex mutex_;
  std::exception_ptr first_;
};

}  // namespace

void run_frames(const KittiSequence& sequence, Odometry& odometry, const FrameVisitor& visit) {
  std::size_t num_started = 0;
  Guard guard;
  const auto start = [&](tbb::flow_control& control) {
    if (guard.is_over() || num_started == sequence.size()) {
      control.stop();
      return FramePtr();
    }
    auto frame = std::make_shared<Frame>();
    frame->index = num_started++;
    frame->started = std::chrono::steady_clock::now();
    return frame;
  };
  const auto read = [&](const FramePtr& frame) {
    guard.run(
        [&] { frame->pixels = timed(Stage::kRead, [&] { return sequence.read(frame->index); }); });
    return frame;
  };
  const auto prepare = [&](const FramePtr& frame) {
    guard.run([&] {
      if (frame->pixels) {
        frame->prepared = odometry.prepare(*frame->pixels);
      }
    });
    return frame;
  };
  FramePtr before;  // whose result the next call brings
  const auto hand_over = [&](const std::optional<FrameResult>& result) {
    if (!result || !before) {
      return;
    }
    if (!visit(before->index, before->pixels, *result)) {
      guard.end();
    }
    if (StageRecorder* recorder = StageRecorder::active()) {
      recorder->add_frame(before->started);
    }
  };
  const auto push = [&](const FramePtr& frame) {
    guard.run([&] {
      hand_over(odometry.push(std::move(frame->prepared)));
      before = frame;
    });
  };

  using tbb::filter_mode;
  tbb::parallel_pipeline(
      kMaxInFlight,
      tbb::make_filter<void, FramePtr>(filter_mode::serial_in_order, start) &
          tbb::make_filter<FramePtr, FramePtr>(filter_mode::parallel, read) &
          tbb::make_filter<FramePtr, FramePtr>(filter_mode::serial_in_order, prepare) &
          tbb::make_filter<FramePtr, void>(filter_mode::serial_in_order, push));
  guard.run([&] { hand_over(odometry.finish()); });
  guard.rethrow();
}

}  // namespace stemvo::pipeline
