// SPDX-License-Identifier: MIT
#include <ctime>

#include "support/test.hpp"
#include "timing/stage_timer.hpp"

namespace stemvo {
namespace {

using namespace std::chrono_literals;

/// Uses the processor until this thread has had it for so long.
void work_for(std::chrono::milliseconds time) {
  const std::clock_t start = std::clock();
  const auto begin = std::chrono::steady_clock::now();
  while (std::chrono::steady_clock::now() - begin < time ||
         std::clock() - start < time.count() * CLOCKS_PER_SEC / 1000) {
  }
}

TEST(Timing, MedianAndP95AreAmongTheTimes) {
  StageRecorder recorder;
  for (int i = 100; i >= 1; --i) {
    recorder.add(Stage::kStem, i, 0.0);
  }
  recorder.add(Stage::kRead, 7.0, 0.0);
  const TimingReport report = recorder.report();
  ASSERT_EQ(report.stages.size(), 2U);
  EXPECT_EQ(report.stages[0].median_ms, 7.0);
  EXPECT_EQ(report.stages[0].p95_ms, 7.0);
  EXPECT_EQ(report.stages[1].median_ms, 50.0);
  EXPECT_EQ(report.stages[1].p95_ms, 95.0);
}

TEST(Timing, AStageHasItsCallsItsWallTimeAndItsProcessorTime) {
  StageRecorder recorder;
  for (int i = 0; i < 3; ++i) {
    timed(Stage::kStem, [] { work_for(10ms); });
  }
  timed(Stage::kRead, [] { std::this_thread::sleep_for(30ms); });
  const TimingReport report = recorder.report();
  ASSERT_EQ(report.stages.size(), 2U);
  EXPECT_EQ(report.stages.front().name, "read and decode") << "in the order of a frame's way";
  const StageTiming& read = report.stages[0];
  const StageTiming& stem = report.stages[1];
  EXPECT_EQ(stem.name, "stem");
  EXPECT_EQ(stem.calls, 3U);
  EXPECT_GE(stem.median_ms, 10.0);
  EXPECT_GE(stem.cpu_s, 0.029);
  EXPECT_GE(read.median_ms, 30.0);
  EXPECT_LT(read.cpu_s, 0.01) << "sleeping is no work";
}

TEST(Timing, ThreadsAreSeenAndSharesAddUp) {
  StageRecorder recorder;
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([] {
      for (int k = 0; k < 50; ++k) {
        const StageTimer timer(Stage::kTracking);
        work_for(1ms);
      }
    });
  }
  for (std::thread& thread : threads) {
    thread.join();
  }
  const TimingReport report = recorder.report();
  ASSERT_EQ(report.stages.size(), 1U);
  EXPECT_EQ(report.stages[0].calls, 200U);
  EXPECT_NEAR(report.rest_cpu_s + report.stages[0].cpu_s, report.cpu_s, 1e-9);
  EXPECT_GE(report.rest_cpu_s, -1e-3) << "the stages have more time than the program";
}

}  // namespace
}  // namespace stemvo
