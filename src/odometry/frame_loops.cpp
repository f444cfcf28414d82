// SPDX-License-Identifier: MIT
#include "odometry/frame_loops.hpp"

#include <condition_variable>
#include <exception>
#include <mutex>
#include <thread>

namespace stemvo {
namespace {

/// The loops wait for each other by counting frames. Nothing but the counters is under the mutex.
class FrameLoops {
 public:
  FrameLoops(const FrameStages& stages, std::size_t num_frames)
      : stages_(stages), num_frames_(num_frames) {}

  void run() {
    const auto guarded = [this](void (FrameLoops::*loop)()) {
      try {
        (this->*loop)();
      } catch (...) {
        stop(std::current_exception());
      }
    };
    std::jthread preparing;
    std::jthread tracking;
    try {
      preparing = std::jthread(guarded, &FrameLoops::read_and_prepare);
      tracking = std::jthread(guarded, &FrameLoops::track_and_localize);
    } catch (...) {  // no more threads to be had
      stop(std::current_exception());
    }
    guarded(&FrameLoops::optimize);
    for (std::jthread* thread : {&preparing, &tracking}) {
      if (thread->joinable()) {
        thread->join();
      }
    }
    if (thrown_ != nullptr) {
      std::rethrow_exception(thrown_);
    }
  }

 private:
  void read_and_prepare() {
    for (std::size_t k = 0; wait(k, [&] { return k < num_optimized_ + kMaxInFlight; }); ++k) {
      if (!stages_.read(k)) {
        end_at(k);
        return;
      }
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
      if (!stages_.optimize(k)) {
        stop(nullptr);
      }
      advance(num_optimized_);
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
  void end_at(std::size_t num_frames) {
    const std::lock_guard lock(mutex_);
    num_frames_ = num_frames;
    changed_.notify_all();
  }
  void stop(const std::exception_ptr& thrown) {
    const std::lock_guard lock(mutex_);
    thrown_ = thrown_ == nullptr ? thrown : thrown_;
    is_stopped_ = true;
    changed_.notify_all();
  }

  const FrameStages& stages_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::size_t num_frames_;  ///< at most; those there are, once a stream has ended
  std::size_t num_prepared_ = 0;
  std::size_t num_localized_ = 0;
  std::size_t num_optimized_ = 0;
  bool is_stopped_ = false;
  std::exception_ptr thrown_;
};

}  // namespace

void run_frame_loops(const FrameStages& stages, std::size_t num_frames, int num_threads) {
  if (num_threads > 1) {
    FrameLoops(stages, num_frames).run();
    return;
  }
  for (std::size_t k = 0; k < num_frames && stages.read(k); ++k) {
    stages.prepare(k);
    stages.track(k);
    stages.localize(k);
    if (!stages.optimize(k)) {
      return;
    }
  }
}

}  // namespace stemvo
