// SPDX-License-Identifier: MIT
#include "pipeline/frame_pipeline.hpp"

#include <array>
#include <atomic>
#include <chrono>
#include <exception>
#include <mutex>
#include <optional>
#include <utility>

#include <tbb/parallel_pipeline.h>

#include "threads/hand_over.hpp"
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
  HandOver between_stages;
};
/// Those on their way, and the last one that came through.
using Frames = std::array<Frame, kMaxInFlight + 1>;

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
  Frames frames;
  HandOver begin;
  HandOver end;
  HandOver between_starts;
  HandOver between_prepares;
  HandOver between_pushes;
  const auto start = [&](tbb::flow_control& control) -> Frame* {
    const Turn turn(between_starts);
    if (guard.is_over() || num_started == sequence.size()) {
      control.stop();
      return nullptr;
    }
    Frame* frame = &frames.at(num_started % frames.size());
    const Turn stage(frame->between_stages);  // of the frame that was here
    frame->index = num_started++;
    frame->started = std::chrono::steady_clock::now();
    frame->prepared = {};
    return frame;
  };
  const auto read = [&](Frame* frame) {
    const Turn stage(frame->between_stages);
    guard.run(
        [&] { frame->pixels = timed(Stage::kRead, [&] { return sequence.read(frame->index); }); });
    return frame;
  };
  const auto prepare = [&](Frame* frame) {
    const Turn turn(between_prepares);
    const Turn stage(frame->between_stages);
    guard.run([&] {
      if (frame->pixels) {
        frame->prepared = odometry.prepare(*frame->pixels);
      }
    });
    return frame;
  };
  Frame* before = nullptr;  // whose result the next call brings
  const auto hand_over = [&](const std::optional<FrameResult>& result) {
    if (!result || before == nullptr) {
      return;
    }
    const Turn stage(before->between_stages);
    if (!visit(before->index, before->pixels, *result)) {
      guard.end();
    }
    if (StageRecorder* recorder = StageRecorder::active()) {
      recorder->add_frame(before->started);
    }
  };
  const auto push = [&](Frame* frame) {
    const Turn turn(between_pushes);
    const Turn stage(frame->between_stages);
    guard.run([&] {
      hand_over(odometry.push(std::move(frame->prepared)));
      before = frame;
    });
  };

  begin.give();
  using tbb::filter_mode;
  tbb::parallel_pipeline(
      kMaxInFlight,
      tbb::make_filter<void, Frame*>(filter_mode::serial_in_order, HandedOver(begin, end, start)) &
          tbb::make_filter<Frame*, Frame*>(filter_mode::parallel, HandedOver(begin, end, read)) &
          tbb::make_filter<Frame*, Frame*>(filter_mode::serial_in_order,
                                           HandedOver(begin, end, prepare)) &
          tbb::make_filter<Frame*, void>(filter_mode::serial_in_order,
                                         HandedOver(begin, end, push)));
  end.take();
  guard.run([&] { hand_over(odometry.finish()); });
  guard.rethrow();
}

}  // namespace stemvo::pipeline
