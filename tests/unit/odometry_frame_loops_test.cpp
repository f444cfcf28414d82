// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <chrono>
#include <functional>
#include <latch>
#include <map>
#include <mutex>
#include <random>
#include <set>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "odometry/frame_loops.hpp"

namespace stemvo {
namespace {

enum Stage { kRead, kPrepare, kTrack, kLocalize, kOptimize };
constexpr std::array kStages = {kRead, kPrepare, kTrack, kLocalize, kOptimize};

/// Notes when each stage begins and ends a frame. `at` is called in between.
class Notes {
 public:
  using At = std::function<void(Stage, std::size_t)>;
  explicit Notes(std::size_t num_there, At at = nullptr)
      : num_there_(num_there), at_(std::move(at)) {}

  [[nodiscard]] FrameStages stages() {
    return {.read = [this](std::size_t k) { return k < num_there_ && note(kRead, k); },
            .prepare = [this](std::size_t k) { note(kPrepare, k); },
            .track = [this](std::size_t k) { note(kTrack, k); },
            .localize = [this](std::size_t k) { note(kLocalize, k); },
            .optimize = [this](std::size_t k) { return note(kOptimize, k) && k != stop_at; }};
  }
  [[nodiscard]] int begin(Stage stage, std::size_t k) const { return spans_.at({stage, k}).first; }
  [[nodiscard]] int end(Stage stage, std::size_t k) const { return spans_.at({stage, k}).second; }
  [[nodiscard]] std::size_t count(Stage stage) const {
    return static_cast<std::size_t>(
        std::ranges::count_if(spans_, [&](const auto& span) { return span.first.first == stage; }));
  }
  [[nodiscard]] const std::set<std::thread::id>& threads() const { return threads_; }

  std::size_t stop_at = 1000000;

 private:
  bool note(Stage stage, std::size_t k) {
    {
      const std::lock_guard lock(mutex_);
      EXPECT_TRUE(spans_.try_emplace({stage, k}, clock_++, -1).second) << "frame " << k << " again";
      threads_.insert(std::this_thread::get_id());
    }
    if (at_) {
      at_(stage, k);
    }
    const std::lock_guard lock(mutex_);
    spans_[{stage, k}].second = clock_++;
    return true;
  }

  std::size_t num_there_;
  At at_;
  std::mutex mutex_;
  int clock_ = 0;
  std::map<std::pair<Stage, std::size_t>, std::pair<int, int>> spans_;
  std::set<std::thread::id> threads_;
};

void nap(Stage /*stage*/, std::size_t /*frame*/) {
  thread_local std::minstd_rand random{std::random_device{}()};
  if (random() % 3 == 0) {
    std::this_thread::sleep_for(std::chrono::microseconds(random() % 300));
  }
}

TEST(FrameLoops, KeepTheOrderWhateverAStageTakes) {
  constexpr std::size_t kNumFrames = 150;
  for (const int num_threads : {1, 2, 4}) {
    Notes notes(kNumFrames, nap);
    run_frame_loops(notes.stages(), kNumFrames, num_threads);
    ASSERT_EQ(notes.count(kOptimize), kNumFrames);
    for (std::size_t k = 0; k < kNumFrames; ++k) {
      for (const Stage stage : {kPrepare, kTrack, kLocalize, kOptimize}) {
        EXPECT_LT(notes.end(static_cast<Stage>(stage - 1), k), notes.begin(stage, k));
      }
      for (const Stage stage : kStages) {
        EXPECT_TRUE(k == 0 || notes.end(stage, k - 1) < notes.begin(stage, k)) << stage;
      }
      EXPECT_TRUE(k == 0 || notes.end(kLocalize, k - 1) < notes.begin(kTrack, k));
      EXPECT_TRUE(k == 0 || notes.end(kOptimize, k - 1) < notes.begin(kLocalize, k));
      EXPECT_TRUE(k < kMaxInFlight ||
                  notes.end(kOptimize, k - kMaxInFlight) < notes.begin(kRead, k))
          << "more frames at work than there is room for";
    }
  }
}

TEST(FrameLoops, WithOneThreadAllRunsInTheCallingOne) {
  Notes notes(5);
  run_frame_loops(notes.stages(), 5, 1);
  EXPECT_EQ(notes.threads(), std::set{std::this_thread::get_id()});
  EXPECT_LT(notes.end(kOptimize, 0), notes.begin(kRead, 1));
}

/// Each of the three waits for the others: without all three at a time the test would not end.
TEST(FrameLoops, TheThreeLoopsRunBesideEachOther) {
  std::latch all(3);
  Notes notes(6, [&](Stage stage, std::size_t k) {
    if ((stage == kOptimize && k == 0) || (stage == kTrack && k == 1) ||
        (stage == kPrepare && k == 2)) {
      all.arrive_and_wait();
    }
  });
  run_frame_loops(notes.stages(), 6, 2);
  EXPECT_EQ(notes.threads().size(), 3U);
  EXPECT_EQ(notes.count(kOptimize), 6U);
}

TEST(FrameLoops, EndWhereAStreamDoes) {
  for (const int num_threads : {1, 2}) {
    for (const std::size_t num_there : {0U, 1U, 4U, 9U}) {
      Notes notes(num_there, nap);
      run_frame_loops(notes.stages(), 1000000, num_threads);
      EXPECT_EQ(notes.count(kOptimize), num_there);
    }
  }
}

TEST(FrameLoops, EndBehindTheFrameWhoseOptimizationSaysSo) {
  for (const int num_threads : {1, 2}) {
    Notes notes(100, nap);
    notes.stop_at = 7;
    run_frame_loops(notes.stages(), 100, num_threads);
    EXPECT_EQ(notes.count(kOptimize), 8U);
  }
}

TEST(FrameLoops, ThrowAgainWhatAStageThrows) {
  for (const int num_threads : {1, 2}) {
    for (const Stage thrower : kStages) {
      Notes notes(100, [&](Stage stage, std::size_t k) {
        nap(stage, k);
        if (stage == thrower && k == 11) {
          throw std::runtime_error("stage " + std::to_string(stage));
        }
      });
      try {
        run_frame_loops(notes.stages(), 100, num_threads);
        ADD_FAILURE() << "nothing was thrown";
      } catch (const std::runtime_error& error) {
        EXPECT_EQ(error.what(), "stage " + std::to_string(thrower));
      }
      EXPECT_LE(notes.count(kOptimize), 12U);
    }
  }
}

}  // namespace
}  // namespace stemvo
