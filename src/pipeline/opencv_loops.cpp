// SPDX-License-Identifier: MIT
#include "pipeline/opencv_loops.hpp"

#include <algorithm>
#include <memory>
#include <mutex>
#include <utility>

#include <opencv2/core/parallel/parallel_backend.hpp>

namespace stemvo::pipeline {
namespace {

/// So many turns per thread let a thread that comes late, or is held up, do less.
constexpr int kTurnsPerThread = 4;

thread_local LoopCrew* crew_of_thread = nullptr;
thread_local int index_of_thread = 0;

/// What cv::parallel_for_ calls in place of OpenCV's own threads. `body` keeps what it throws:
/// OpenCV throws it again when the loop is over.
class CrewBackend : public cv::parallel::ParallelForAPI {
 public:
  void parallel_for(int num_stripes, FN_parallel_for_body_cb_t body, void* data) override {
    if (crew_of_thread == nullptr || num_stripes < 2) {
      body(0, num_stripes, data);
      return;
    }
    crew_of_thread->run_loop(num_stripes,
                             [body, data](int begin, int end) { body(begin, end, data); });
  }
  [[nodiscard]] int getThreadNum() const override { return index_of_thread; }
  [[nodiscard]] int getNumThreads() const override {
    return crew_of_thread != nullptr ? crew_of_thread->num_threads() : 1;
  }
  int setNumThreads(int) override { return getNumThreads(); }  // the crew stays what it is
  [[nodiscard]] const char* getName() const override { return "stemvo"; }
};

std::mutex uses_mutex;
int num_uses = 0;

}  // namespace

SharedLoop::SharedLoop(int num_stripes, int num_threads, Body body)
    : num_stripes_(num_stripes),
      stripes_at_once_(std::max(1, num_stripes / (kTurnsPerThread * num_threads))),
      body_(std::move(body)) {}

void SharedLoop::work() {
  while (has_stripes_left()) {
    const int begin = next_.fetch_add(stripes_at_once_);
    if (begin < num_stripes_) {
      body_(begin, std::min(begin + stripes_at_once_, num_stripes_));
    }
  }
}

OpenCvLoops::OpenCvLoops() {
  const std::lock_guard lock(uses_mutex);
  if (num_uses++ == 0) {
    static const auto backend = std::make_shared<CrewBackend>();
    cv::parallel::setParallelForBackend(backend, false);
  }
}

OpenCvLoops::~OpenCvLoops() {
  const std::lock_guard lock(uses_mutex);
  if (--num_uses == 0) {
    cv::parallel::setParallelForBackend(std::shared_ptr<cv::parallel::ParallelForAPI>(), false);
  }
}

CrewMember::CrewMember(LoopCrew& crew, int index)
    : crew_before_(std::exchange(crew_of_thread, &crew)),
      index_before_(std::exchange(index_of_thread, index)) {}

CrewMember::~CrewMember() {
  crew_of_thread = crew_before_;
  index_of_thread = index_before_;
}

}  // namespace stemvo::pipeline
