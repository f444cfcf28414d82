// SPDX-License-Identifier: MIT
#include "pipeline/frame_pipeline.hpp"

#include <array>
#include <atomic>
#include <chrono>
#include <exception>
#include <mutex>
#include <optional>
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

/// What the stages do; which of them may work at the same time is the graph's business.
class Stages {
 public:
  Stages(const KittiSequence& sequence, Odometry& odometry, const FrameVisitor& visit)
      : sequence_(sequence), odometry_(odometry), visit_(visit) {}

  /// False: there are no more frames.
  bool start(Frame& frame) {
    const Turn turn(between_starts_);
    if (guard_.is_over() || num_started_ == sequence_.size()) {
      return false;
    }
    const Turn stage(frame.between_stages);  // of the frame that was here
    frame.index = num_started_++;
    frame.started = std::chrono::steady_clock::now();
    frame.prepared = {};
    return true;
  }
  void read(Frame& frame) {
    const Turn stage(frame.between_stages);
    guard_.run(
        [&] { frame.pixels = timed(Stage::kRead, [&] { return sequence_.read(frame.index); }); });
  }
  void prepare(Frame& frame) {
    const Turn turn(between_prepares_);
    const Turn stage(frame.between_stages);
    guard_.run([&] {
      if (frame.pixels) {
        frame.prepared = odometry_.prepare(*frame.pixels);
      }
    });
  }
  void follow(Frame& frame) {
    const Turn turn(between_steps_);
    const Turn stage(frame.between_stages);
    guard_.run([&] { odometry_.follow(std::move(frame.prepared)); });
  }
  void finish(Frame& frame) {
    const Turn turn(between_steps_);
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
  void place() {
    const Turn turn(between_steps_);
    guard_.run([&] { odometry_.place(); });
  }
  void rethrow() const { guard_.rethrow(); }

 private:
  const KittiSequence& sequence_;
  Odometry& odometry_;
  const FrameVisitor& visit_;
  std::size_t num_started_ = 0;
  Guard guard_;
  HandOver between_starts_;
  HandOver between_prepares_;
  HandOver between_steps_;  ///< of the odometry: follow, finish, place
};

}  // namespace

void run_frames(const KittiSequence& sequence, Odometry& odometry, const FrameVisitor& visit) {
  namespace flow = tbb::flow;
  using Pair = std::tuple<Frame*, Frame*>;  // a frame, and the one before (null: it is the first)
  using Starts = flow::multifunction_node<Frame*, std::tuple<Frame*>>;

  Stages stages(sequence, odometry, visit);
  const auto start = [&](Frame* frame, Starts::output_ports_type& ports) {
    if (frame != nullptr && stages.start(*frame)) {
      std::get<0>(ports).try_put(frame);
    }
  };
  const auto read = [&](Frame* frame) { return stages.read(*frame), frame; };
  const auto prepare = [&](Frame* frame) { return stages.prepare(*frame), frame; };
  const auto follow = [&](const Pair& pair) {
    stages.follow(*std::get<0>(pair));
    return std::get<0>(pair);
  };
  const auto finish = [&](const Pair& pair) {
    Frame* const before = std::get<1>(pair);
    if (before != nullptr) {
      stages.finish(*before);
    }
    return before;
  };
  Frame* last = nullptr;
  const auto place = [&](const Pair& pair) {
    stages.place();
    return last = std::get<0>(pair);
  };

  HandOver begin;
  HandOver end;
  flow::graph graph;
  Starts starts(graph, flow::serial, HandedOver(begin, end, start));
  flow::function_node<Frame*, Frame*> reads(graph, flow::unlimited, HandedOver(begin, end, read));
  flow::sequencer_node<Frame*> in_order(graph, [](Frame* frame) { return frame->index; });
  flow::function_node<Frame*, Frame*> prepares(graph, flow::serial,
                                               HandedOver(begin, end, prepare));
  flow::join_node<Pair> steps(graph);
  flow::function_node<Pair, Frame*> follows(graph, flow::serial, HandedOver(begin, end, follow),
                                            kUrgent);
  flow::function_node<Pair, Frame*> finishes(graph, flow::serial, HandedOver(begin, end, finish),
                                             kUrgent);
  flow::join_node<Pair> both(graph);
  flow::function_node<Pair, Frame*> places(graph, flow::serial, HandedOver(begin, end, place),
                                           kUrgent);
  flow::make_edge(flow::output_port<0>(starts), reads);
  flow::make_edge(reads, in_order);
  flow::make_edge(in_order, prepares);
  flow::make_edge(prepares, flow::input_port<0>(steps));
  flow::make_edge(steps, follows);   // the frame ..
  flow::make_edge(steps, finishes);  // .. beside the one before
  flow::make_edge(follows, flow::input_port<0>(both));
  flow::make_edge(finishes, flow::input_port<1>(both));
  flow::make_edge(finishes, starts);  // its place is free for the next one to be read
  flow::make_edge(both, places);
  flow::make_edge(places, flow::input_port<1>(steps));

  std::array<Frame, kMaxInFlight> frames;
  begin.give();
  flow::input_port<1>(steps).try_put(nullptr);
  for (Frame& frame : frames) {
    starts.try_put(&frame);
  }
  graph.wait_for_all();
  end.take();
  if (last != nullptr) {
    stages.finish(*last);
  }
  stages.rethrow();
}

}  // namespace stemvo::pipeline
