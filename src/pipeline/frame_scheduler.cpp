// SPDX-License-Identifier: MIT
#include "pipeline/frame_scheduler.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <condition_variable>
#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include <opencv2/core/parallel/parallel_backend.hpp>

namespace stemvo::pipeline {
namespace {

enum StageId : std::size_t { kRead, kPrepare, kTrack, kLocalize, kOptimize, kNumStageIds };
/// What the next frame waits for goes before what only fills the queue.
constexpr std::array kMostUrgentFirst = {kLocalize, kOptimize, kTrack, kPrepare, kRead};

struct Job {
  StageId stage = kRead;
  std::size_t frame = 0;
};

/// A loop of OpenCV that several threads work on. Each takes stripes of it until none is left.
class SharedLoop {
 public:
  using Body = std::function<void(int begin, int end)>;
  SharedLoop(int num_stripes, int num_threads, const Body& body)
      : num_stripes_(num_stripes),
        stripes_at_once_(std::max(1, num_stripes / (kTurnsPerThread * num_threads))),
        body_(body) {}

  [[nodiscard]] bool has_stripes_left() const { return next_ < num_stripes_; }
  void work() {
    while (has_stripes_left()) {
      const int begin = next_.fetch_add(stripes_at_once_);
      if (begin < num_stripes_) {
        body_(begin, std::min(begin + stripes_at_once_, num_stripes_));
      }
    }
  }

  int num_helpers = 0;  ///< threads in work() beside the one whose loop it is

 private:
  /// So many turns per thread let a thread that comes late, or is held up, do less.
  static constexpr int kTurnsPerThread = 4;

  int num_stripes_;
  int stripes_at_once_;
  const Body& body_;
  std::atomic<int> next_ = 0;
};

/// A free thread takes the most urgent stage that can run. Everything but the stages themselves
/// happens under one mutex: which frame a stage is given is a counter there.
class FrameScheduler {
 public:
  FrameScheduler(const FrameStages& stages, std::size_t num_frames, int num_threads)
      : stages_(stages), num_frames_(num_frames), num_threads_(num_threads) {}

  void run();
  [[nodiscard]] int num_threads() const { return num_threads_; }

  /// Called by a thread of its own; returns when all of the loop is done.
  void run_loop(int num_stripes, const SharedLoop::Body& body) {
    SharedLoop loop(num_stripes, num_threads_, body);
    std::unique_lock lock(mutex_);
    if (loop_ != nullptr) {
      lock.unlock();
      body(0, num_stripes);
      return;
    }
    loop_ = &loop;
    wake_one();
    lock.unlock();
    loop.work();
    lock.lock();
    loop_ = nullptr;
    helped_.wait(lock, [&loop] { return loop.num_helpers == 0; });
  }

 private:
  struct Progress {
    std::size_t num_begun = 0;
    std::size_t num_done = 0;
  };

  void work(int thread);

  void run_on_threads() {
    std::vector<std::jthread> threads;
    try {
      for (int i = 1; i < num_threads_; ++i) {
        threads.emplace_back([this, i] { work(i); });
      }
    } catch (...) {  // no more threads to be had
      const std::lock_guard lock(mutex_);
      thrown_ = thrown_ == nullptr ? std::current_exception() : thrown_;
      is_ended_ = true;
      changed_.notify_all();
    }
    work(0);
  }

  [[nodiscard]] bool run_stage(const Job& job) const {
    if (job.stage == kOptimize || job.stage == kRead) {
      return (job.stage == kRead ? stages_.read : stages_.optimize)(job.frame);
    }
    const std::array stages = {&stages_.prepare, &stages_.track, &stages_.localize};
    (*stages.at(job.stage - kPrepare))(job.frame);
    return true;
  }

  // With the mutex held.

  [[nodiscard]] bool is_over() const {
    return is_ended_ || progress_[kOptimize].num_done == num_frames_;
  }
  [[nodiscard]] bool is_help_wanted() const {
    return loop_ != nullptr && loop_->has_stripes_left();
  }

  [[nodiscard]] bool can_run(StageId stage) const {
    const Progress& own = progress_[stage];
    const std::size_t frame = own.num_begun;
    const bool is_busy = stage != kRead && own.num_begun > own.num_done;
    if (is_over() || is_busy || frame >= num_frames_) {
      return false;
    }
    switch (stage) {
      case kRead:
        return frame < progress_[kOptimize].num_done + kMaxInFlight;
      case kPrepare:
        return is_read_[frame % kMaxInFlight];
      case kTrack:
        return progress_[kPrepare].num_done > frame && progress_[kLocalize].num_done == frame;
      case kLocalize:
        return progress_[kTrack].num_done > frame && progress_[kOptimize].num_done == frame;
      default:
        return progress_[kLocalize].num_done > frame;
    }
  }

  [[nodiscard]] std::optional<Job> next_job() const {
    for (const StageId stage : kMostUrgentFirst) {
      if (can_run(stage)) {
        return Job{stage, progress_[stage].num_begun};
      }
    }
    return std::nullopt;
  }

  void begin(const Job& job) {
    ++progress_[job.stage].num_begun;
    if (job.stage == kPrepare) {
      is_read_[job.frame % kMaxInFlight] = false;
    }
  }

  void end(const Job& job, bool goes_on) {
    ++progress_[job.stage].num_done;
    if (job.stage == kRead) {
      is_read_[job.frame % kMaxInFlight] = true;
    }
    if (job.stage == kRead && !goes_on) {
      num_frames_ = std::min(num_frames_, job.frame);
    }
    is_ended_ = is_ended_ || (job.stage == kOptimize && !goes_on);
    if (is_over()) {
      changed_.notify_all();
    }
  }

  /// Whoever finds something to do wakes the next one, if there is more.
  void wake_one() {
    if (num_idle_ > 0 && (is_help_wanted() || next_job())) {
      changed_.notify_one();
    }
  }

  void help(std::unique_lock<std::mutex>& lock) {
    SharedLoop& loop = *loop_;
    ++loop.num_helpers;
    wake_one();
    lock.unlock();
    loop.work();
    lock.lock();
    if (--loop.num_helpers == 0) {
      helped_.notify_all();
    }
  }

  const FrameStages& stages_;
  std::size_t num_frames_;  ///< at most; those there are, once a stream has ended
  const int num_threads_;

  std::mutex mutex_;
  std::condition_variable changed_;  ///< there is more to do, or nothing any more
  std::condition_variable helped_;
  std::array<Progress, kNumStageIds> progress_;
  std::array<bool, kMaxInFlight> is_read_{};  ///< and not begun to be prepared
  bool is_ended_ = false;                     ///< before the last frame
  std::exception_ptr thrown_;
  int num_idle_ = 0;
  SharedLoop* loop_ = nullptr;  ///< OpenCV has one at a time
};

thread_local FrameScheduler* scheduler_of_thread = nullptr;
thread_local int index_of_thread = 0;

/// What cv::parallel_for_ calls in place of OpenCV's own threads. `body` keeps what it throws:
/// OpenCV throws it again when the loop is over.
class SchedulerBackend : public cv::parallel::ParallelForAPI {
 public:
  void parallel_for(int num_stripes, FN_parallel_for_body_cb_t body, void* data) override {
    if (scheduler_of_thread == nullptr || num_stripes < 2) {
      body(0, num_stripes, data);
    } else {
      scheduler_of_thread->run_loop(num_stripes,
                                    [body, data](int begin, int end) { body(begin, end, data); });
    }
  }
  [[nodiscard]] int getThreadNum() const override { return index_of_thread; }
  [[nodiscard]] int getNumThreads() const override {
    return scheduler_of_thread != nullptr ? scheduler_of_thread->num_threads() : 1;
  }
  int setNumThreads(int) override { return getNumThreads(); }  // they stay as many as they are
  [[nodiscard]] const char* getName() const override { return "stemvo"; }
};

/// While one lives, OpenCV's loops (cv::parallel_for_) of a scheduler's threads are run by that
/// scheduler, those of other threads by the calling thread alone: OpenCV's own threads rest. The
/// first is made and the last destroyed while no scheduler works.
class OpenCvLoops {
 public:
  OpenCvLoops() {
    const std::lock_guard lock(mutex);
    if (num_uses++ == 0) {
      static const auto backend = std::make_shared<SchedulerBackend>();
      cv::parallel::setParallelForBackend(backend, false);
    }
  }
  ~OpenCvLoops() {
    const std::lock_guard lock(mutex);
    if (--num_uses == 0) {
      cv::parallel::setParallelForBackend(std::shared_ptr<cv::parallel::ParallelForAPI>(), false);
    }
  }
  OpenCvLoops(const OpenCvLoops&) = delete;
  OpenCvLoops& operator=(const OpenCvLoops&) = delete;

 private:
  static inline std::mutex mutex;
  static inline int num_uses = 0;
};

void FrameScheduler::run() {
  if (num_threads_ > 1) {
    const OpenCvLoops loops;
    run_on_threads();
  } else {
    work(0);
  }
  if (thrown_ != nullptr) {
    std::rethrow_exception(thrown_);
  }
}

void FrameScheduler::work(int thread) {
  FrameScheduler* const scheduler_before = std::exchange(scheduler_of_thread, this);
  const int index_before = std::exchange(index_of_thread, thread);
  std::unique_lock lock(mutex_);
  while (!is_over()) {
    if (const std::optional<Job> job = next_job()) {
      begin(*job);
      wake_one();
      lock.unlock();
      bool goes_on = false;
      std::exception_ptr thrown;
      try {
        goes_on = run_stage(*job);
      } catch (...) {
        thrown = std::current_exception();
      }
      lock.lock();
      thrown_ = thrown_ == nullptr ? thrown : thrown_;
      is_ended_ = is_ended_ || thrown != nullptr;
      end(*job, goes_on);
    } else if (is_help_wanted()) {
      help(lock);
    } else {
      ++num_idle_;
      changed_.wait(lock);
      --num_idle_;
    }
  }
  scheduler_of_thread = scheduler_before;
  index_of_thread = index_before;
}

}  // namespace

void run_stages(const FrameStages& stages, std::size_t num_frames, int num_threads) {
  FrameScheduler(stages, num_frames, num_threads).run();
}

}  // namespace stemvo::pipeline
