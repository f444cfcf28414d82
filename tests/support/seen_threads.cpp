// SPDX-License-Identifier: MIT
// OpenCV's loops on threads that the thread sanitizer sees: those of Debian's OpenCV wait for one
// another in a library that is not built for it, and every loop would be reported.
#include <atomic>

#include <opencv2/core/parallel/parallel_backend.hpp>

#include "support/test.hpp"

namespace stemvo::test {
namespace {

constexpr int kNumThreads = 3;
thread_local int thread_index = -1;  ///< -1: outside a loop

class SeenThreads : public cv::parallel::ParallelForAPI {
 public:
  void parallel_for(int num_stripes, FN_parallel_for_body_cb_t body, void* data) override {
    if (thread_index >= 0) {  // a loop in a loop
      body(0, num_stripes, data);
      return;
    }
    std::atomic<int> next = 0;
    std::vector<std::jthread> threads;
    for (int i = 0; i < std::min(num_threads_, num_stripes); ++i) {
      threads.emplace_back([&, i] {
        thread_index = i;
        for (int stripe = next++; stripe < num_stripes; stripe = next++) {
          body(stripe, stripe + 1, data);
        }
      });
    }
  }
  [[nodiscard]] int getThreadNum() const override { return std::max(thread_index, 0); }
  [[nodiscard]] int getNumThreads() const override { return num_threads_; }
  int setNumThreads(int num_threads) override {
    return std::exchange(num_threads_, num_threads > 0 ? num_threads : kNumThreads);
  }
  [[nodiscard]] const char* getName() const override { return "seen threads"; }

 private:
  int num_threads_ = kNumThreads;
};

/// Before each suite and each test: a run of the pipeline sets OpenCV's own back.
class UseSeenThreads : public ::testing::EmptyTestEventListener {
  void OnTestSuiteStart(const ::testing::TestSuite&) override { use(); }
  void OnTestStart(const ::testing::TestInfo&) override { use(); }
  static void use() { cv::parallel::setParallelForBackend(std::make_shared<SeenThreads>(), false); }
};

[[maybe_unused]] const bool is_used = [] {
  ::testing::UnitTest::GetInstance()->listeners().Append(new UseSeenThreads);
  return true;
}();

}  // namespace
}  // namespace stemvo::test
