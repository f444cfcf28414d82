// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <condition_variable>
#include <cstddef>
#include <exception>
#include <functional>
#include <limits>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>

#include "odometry/phased_odometry.hpp"
#include "odometry/way.hpp"
#include "stemvo/error.hpp"
#include "stemvo/frame_result.hpp"
#include "stemvo/odometry.hpp"

namespace stemvo {

/// Frames at work at a time, the one whose result is awaited among them. Frame k + kMaxInFlight is
/// taken when frame k is optimized: a ring of so many frames is enough.
inline constexpr std::size_t kMaxInFlight = 6;

/// A frame goes through these, in this order; each is given the frame's number, counted from 0.
/// Each stage takes the frames in order.
struct FrameStages {
  std::function<void(std::size_t)> prepare;
  std::function<void(std::size_t)> track;     ///< after localize() of the frame before
  std::function<void(std::size_t)> localize;  ///< after optimize() of the frame before
  std::function<bool(std::size_t)> optimize;  ///< beside track() of the next; false ends the run
};

/// Takes frames through three loops, each in a thread: prepare, track and localize, optimize. With
/// one thread push() takes its frame through all stages. A stage that throws ends the run. Frames
/// begun are dropped where a run ends before finish(). One call at a time.
class FrameLoops {
 public:
  /// std::system_error: no more threads are to be had.
  FrameLoops(FrameStages stages, int num_threads);
  ~FrameLoops() { stop(nullptr); }
  FrameLoops(const FrameLoops&) = delete;
  FrameLoops& operator=(const FrameLoops&) = delete;

  /// Waits for room and has `fill` put the next frame, whose number it is given, in its place.
  /// False: the run has ended. A frame whose fill() throws was never there.
  [[nodiscard]] bool push(const std::function<void(std::size_t)>& fill);
  /// Waits until all frames pushed are done. False: the run has ended.
  [[nodiscard]] bool wait_for_all() {
    const std::size_t next = num_pushed_;
    return wait(next, [&] { return num_optimized_ == next; });
  }
  /// Waits until frame k is done, or there is none to wait for: the run has ended, or does without
  /// it. This one may be called beside the others.
  bool wait_for(std::size_t k) {
    return wait(k, [&] { return k < num_optimized_; });
  }
  /// Waits likewise, ends the run, and throws again what a stage threw.
  void finish() {
    {
      const std::lock_guard lock(mutex_);
      num_frames_ = num_pushed_;
      changed_.notify_all();
    }
    threads_.clear();
    if (thrown_ != nullptr) {
      std::rethrow_exception(thrown_);
    }
  }
  /// finish() throws.
  [[nodiscard]] bool has_thrown() const {
    const std::lock_guard lock(mutex_);
    return thrown_ != nullptr;
  }

 private:
  void prepare() {
    for (std::size_t k = 0; wait(k, [&] { return k < num_pushed_; }); ++k) {
      stages_.prepare(k);
      advance(num_prepared_);
    }
  }
  void track_and_localize() {
    for (std::size_t k = 0; wait(k, [&] { return k < num_prepared_; }); ++k) {
      stages_.track(k);
      if (wait(k, [&] { return k == num_optimized_; })) {
        stages_.localize(k);
        advance(num_localized_);
      }
    }
  }
  void optimize() {
    for (std::size_t k = 0; wait(k, [&] { return k < num_localized_; }); ++k) {
      end_frame(k);
    }
  }
  void take_through(std::size_t k) {
    stages_.prepare(k);
    stages_.track(k);
    stages_.localize(k);
    end_frame(k);
  }
  void end_frame(std::size_t k) {
    if (!stages_.optimize(k)) {
      stop(nullptr);
    }
    advance(num_optimized_);
  }

  template <typename Work>
  void guard(const Work& work) {
    try {
      work();
    } catch (...) {
      stop(std::current_exception());
    }
  }
  /// Until `may_go_on`; false: frame k is not to be done.
  template <typename Condition>
  [[nodiscard]] bool wait(std::size_t k, const Condition& may_go_on) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return is_stopped_ || k >= num_frames_ || may_go_on(); });
    return !is_stopped_ && k < num_frames_;
  }
  void advance(std::size_t& count) {
    const std::lock_guard lock(mutex_);
    ++count;
    changed_.notify_all();
  }
  void stop(const std::exception_ptr& thrown) {
    const std::lock_guard lock(mutex_);
    thrown_ = thrown_ == nullptr ? thrown : thrown_;
    is_stopped_ = true;
    changed_.notify_all();
  }

  FrameStages stages_;
  // The loops wait for each other by counting frames; the mutex guards what follows.
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::size_t num_frames_ = std::numeric_limits<std::size_t>::max();  ///< known once all are there
  std::size_t num_pushed_ = 0;
  std::size_t num_prepared_ = 0;
  std::size_t num_localized_ = 0;
  std::size_t num_optimized_ = 0;
  bool is_stopped_ = false;
  std::exception_ptr thrown_;
  std::vector<std::jthread> threads_;  ///< last, so that they end first
};

/// A frame as it comes: the pixels, as PhasedOdometry::prepare takes them, are nobody else's; an
/// Error where they could not be read.
struct GivenFrame {
  Expected<cv::Mat> image;
  double time_s = 0.0;
  FrameHints hints;
  std::vector<Way> ways = {};  ///< that came before it did
};

/// Takes frames through an odometry in FrameLoops; the results are the same for any number of
/// threads.
class OdometryLoops {
 public:
  /// Called for each frame, in order, one call at a time, from another thread where there are
  /// several, while the odometry holds what it knows of this frame. False ends the run.
  using Deliver = std::function<bool(const GivenFrame&, const FrameResult&)>;

  /// The odometry outlives this, and is used by nobody else meanwhile.
  OdometryLoops(PhasedOdometry& odometry, Deliver deliver, int num_threads)
      : odometry_(odometry), deliver_(std::move(deliver)), loops_(stages(), num_threads) {}

  /// The calls of FrameLoops. What `deliver` throws ends the run too.
  [[nodiscard]] bool push(GivenFrame given) {
    return loops_.push([&](std::size_t k) { slot(k).given = std::move(given); });
  }
  void wait_for(std::size_t k) { loops_.wait_for(k); }
  void finish() { loops_.finish(); }
  [[nodiscard]] bool has_thrown() const { return loops_.has_thrown(); }
  /// Waits for all frames pushed, then PhasedOdometry::reset(). False: the run has ended before.
  [[nodiscard]] bool reset() {
    if (!loops_.wait_for_all()) {
      return false;
    }
    const std::lock_guard lock(state_);
    odometry_.reset();
    return true;
  }

  /// The answer of `ask` about the odometry as it was left by some frame: in `deliver` by the one
  /// delivered.
  template <typename Ask>
  [[nodiscard]] auto ask(const Ask& ask) const {
    const std::lock_guard lock(state_);
    return ask(odometry_.frames());
  }

 private:
  struct Slot {
    GivenFrame given;
    Frame frame;
  };
  [[nodiscard]] Slot& slot(std::size_t k) { return ring_[k % kMaxInFlight]; }
  [[nodiscard]] FrameStages stages();

  PhasedOdometry& odometry_;
  Deliver deliver_;
  std::array<Slot, kMaxInFlight> ring_;
  mutable std::mutex state_;  ///< of what localize() and optimize() change
  FrameLoops loops_;          ///< last, so that its threads end first
};

}  // namespace stemvo
