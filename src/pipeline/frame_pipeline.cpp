// SPDX-License-Identifier: MIT
#include "pipeline/frame_pipeline.hpp"

#include <array>
#include <atomic>
#include <chrono>
#include <exception>
#include <mutex>
#include <span>
#include <tuple>
#include <utility>

#include <tbb/flow_graph.h>

#include "threads/hand_over.hpp"
#include "timing/stage_timer.hpp"

namespace stemvo::pipeline {
namespace {

/// Frames at work at a time, the one whose result is awaited among them: enough that no stage waits
/// for another's slow frame.
constexpr std::size_t kMaxInFlight = 6;
/// What the next frame waits for goes before what only fills the queue.
constexpr tbb::flow::node_priority_t kUrgent = 1;

struct Frame {
  std::size_t index = 0;
  std::chrono::steady_clock::time_point started;
  Expected<cv::Mat> pixels;
  PreparedFrame prepared;
  HandOver between_stages;
};

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

namespace flow = tbb::flow;
/// A frame, and the one before; null: it is the first.
using FrameAndBefore = std::tuple<Frame*, Frame*>;
using Starts = flow::multifunction_node<Frame*, std::tuple<Frame*>>;

/// What the nodes of the graph do.
class Stages {
 public:
  Stages(const FrameSource& sequence, Odometry& odometry, const FrameVisitor& visit)
      : sequence_(sequence), odometry_(odometry), visit_(visit) {}

  /// Gives a free place to the next frame, if there is one. Null: there was no frame to be freed.
  void start(Frame* frame, Starts::output_ports_type& started) {
    const Turn turn(between_starts_);
    if (frame == nullptr || guard_.is_over() || num_started_ == sequence_.size()) {
      return;
    }
    {
      const Turn stage(frame->between_stages);  // of the frame that was here
      frame->index = num_started_++;
      frame->started = std::chrono::steady_clock::now();
      frame->prepared = {};
    }
    std::get<0>(started).try_put(frame);
  }
  Frame* read(Frame* frame) {
    const Turn stage(frame->between_stages);
    guard_.run(
        [&] { frame->pixels = timed(Stage::kRead, [&] { return sequence_.read(frame->index); }); });
    return frame;
  }
  Frame* prepare(Frame* frame) {
    const Turn turn(between_prepares_);
    const Turn stage(frame->between_stages);
    guard_.run([&] {
      if (frame->pixels) {
        frame->prepared = odometry_.prepare(*frame->pixels);
      }
    });
    return frame;
  }
  Frame* follow(const FrameAndBefore& pair) {
    const Turn turn(placed_, followed_);
    Frame* const frame = std::get<0>(pair);
    const Turn stage(frame->between_stages);
    guard_.run([&] { odometry_.follow(std::move(frame->prepared)); });
    return frame;
  }
  /// Of the one before, whose place is free then.
  Frame* finish(const FrameAndBefore& pair) {
    const Turn turn(placed_, finished_);
    Frame* const before = std::get<1>(pair);
    if (before != nullptr) {
      hand_result_over(*before);
    }
    return before;
  }
  Frame* place(const FrameAndBefore& pair) {
    const Turn after_follow(followed_, placed_);
    const Turn after_finish(finished_, placed_);
    guard_.run([&] { odometry_.place(); });
    last_placed_ = std::get<0>(pair);
    return last_placed_;
  }
  /// Once the graph has nothing more to do. Throws what a stage threw.
  void end() {
    if (last_placed_ != nullptr) {
      hand_result_over(*last_placed_);
    }
    guard_.rethrow();
  }

 private:
  void hand_result_over(Frame& frame) {
    const Turn stage(frame.between_stages);
    guard_.run([&] {
      const FrameResult result = odometry_.finish();
      if (!visit_(frame.index, frame.pixels, result)) {
        guard_.end();
      }
      if (StageRecorder* recorder = StageRecorder::active()) {
        recorder->add_frame(frame.started);
      }
    });
  }

  const FrameSource& sequence_;
  Odometry& odometry_;
  const FrameVisitor& visit_;
  std::size_t num_started_ = 0;
  Frame* last_placed_ = nullptr;
  Guard guard_;
  HandOver between_starts_;
  HandOver between_prepares_;
  HandOver placed_;
  HandOver followed_;
  HandOver finished_;
};

/// What waits for what (docs/architecture.md).
class FrameGraph {
 public:
  explicit FrameGraph(Stages& stages)
      : starts_(graph_, flow::serial, body<&Stages::start>(stages)),
        reads_(graph_, flow::unlimited, body<&Stages::read>(stages)),
        in_order_(graph_, [](Frame* frame) { return frame->index; }),
        prepares_(graph_, flow::serial, body<&Stages::prepare>(stages)),
        steps_(graph_),
        follows_(graph_, flow::serial, body<&Stages::follow>(stages), kUrgent),
        finishes_(graph_, flow::serial, body<&Stages::finish>(stages), kUrgent),
        both_(graph_),
        places_(graph_, flow::serial, body<&Stages::place>(stages), kUrgent) {
    flow::make_edge(flow::output_port<0>(starts_), reads_);
    flow::make_edge(reads_, in_order_);
    flow::make_edge(in_order_, prepares_);
    flow::make_edge(prepares_, flow::input_port<0>(steps_));
    flow::make_edge(steps_, follows_);   // the frame ..
    flow::make_edge(steps_, finishes_);  // .. beside the one before
    flow::make_edge(follows_, flow::input_port<0>(both_));
    flow::make_edge(finishes_, flow::input_port<1>(both_));
    flow::make_edge(finishes_, starts_);
    flow::make_edge(both_, places_);
    flow::make_edge(places_, flow::input_port<1>(steps_));
  }

  /// Until no frame is left.
  void run(std::span<Frame> places) {
    begin_.give();
    flow::input_port<1>(steps_).try_put(nullptr);
    for (Frame& place : places) {
      starts_.try_put(&place);
    }
    graph_.wait_for_all();
    end_.take();
  }

 private:
  template <auto kMethod>
  HandedOver<kMethod, Stages> body(Stages& stages) {
    return {begin_, end_, stages};
  }

  HandOver begin_;
  HandOver end_;
  flow::graph graph_;
  Starts starts_;
  flow::function_node<Frame*, Frame*> reads_;
  flow::sequencer_node<Frame*> in_order_;
  flow::function_node<Frame*, Frame*> prepares_;
  flow::join_node<FrameAndBefore> steps_;
  flow::function_node<FrameAndBefore, Frame*> follows_;
  flow::function_node<FrameAndBefore, Frame*> finishes_;
  flow::join_node<FrameAndBefore> both_;
  flow::function_node<FrameAndBefore, Frame*> places_;
};

}  // namespace

void run_frames(const FrameSource& sequence, Odometry& odometry, const FrameVisitor& visit) {
  std::array<Frame, kMaxInFlight> places;
  Stages stages(sequence, odometry, visit);
  FrameGraph(stages).run(places);
  stages.end();
}

}  // namespace stemvo::pipeline
