// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <limits>
#include <mutex>
#include <numeric>
#include <random>
#include <set>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/core/utility.hpp>

#include "pipeline/frame_scheduler.hpp"
#include "pipeline/thread_scope.hpp"

namespace stemvo::pipeline {
namespace {

using namespace std::chrono_literals;

enum Name { kRead, kPrepare, kTrack, kLocalize, kOptimize, kNumNames };
constexpr std::array kSerial = {kPrepare, kTrack, kLocalize, kOptimize};
constexpr auto kPatience = 20s;  ///< nobody waits that long but where a test fails

/// When a stage had which frame: places in the one list of all beginnings and ends.
struct Span {
  int begin = -1;
  int end = -1;
};

/// Writes down what the stages do, which take their time as it comes.
class Diary {
 public:
  Diary(std::size_t num_frames, int longest_nap_us) : longest_nap_us_(longest_nap_us) {
    spans_.fill(std::vector<Span>(num_frames));
  }

  void record(Name name, std::size_t frame) {
    {
      const std::lock_guard lock(mutex_);
      Span& span = spans_[name].at(frame);
      EXPECT_EQ(span.begin, -1) << "stage " << name << " has frame " << frame << " again";
      span.begin = clock_++;
      order_[name].push_back(frame);
      threads_.insert(std::this_thread::get_id());
      most_at_once_ = std::max(most_at_once_, ++num_at_work_);
    }
    nap();
    {
      const std::lock_guard lock(mutex_);
      spans_[name][frame].end = clock_++;
      --num_at_work_;
    }
    nap();  // between a stage's work and what comes after it
  }

  [[nodiscard]] FrameStages stages() {
    return {.read =
                [this](std::size_t k) {
                  const bool is_there = k < num_there_;
                  if (is_there) {
                    record(kRead, k);
                  }
                  return is_there;
                },
            .prepare = [this](std::size_t k) { record(kPrepare, k); },
            .track = [this](std::size_t k) { record(kTrack, k); },
            .localize = [this](std::size_t k) { record(kLocalize, k); },
            .optimize =
                [this](std::size_t k) {
                  record(kOptimize, k);
                  return true;
                }};
  }

  /// Frames behind it are asked for and are not there.
  void set_num_there(std::size_t num_there) { num_there_ = num_there; }

  [[nodiscard]] const Span& at(Name name, std::size_t frame) const {
    return spans_[name].at(frame);
  }
  [[nodiscard]] const std::vector<std::size_t>& order(Name name) const { return order_[name]; }
  [[nodiscard]] const std::set<std::thread::id>& threads() const { return threads_; }
  [[nodiscard]] int most_at_once() const { return most_at_once_; }

 private:
  void nap() const {
    thread_local std::minstd_rand random{std::random_device{}()};
    if (longest_nap_us_ > 0 && random() % 3 == 0) {
      std::uniform_int_distribution<int> nap_us(0, longest_nap_us_);
      std::this_thread::sleep_for(std::chrono::microseconds(nap_us(random)));
    }
  }

  std::size_t num_there_ = 1000000;
  int longest_nap_us_;
  std::mutex mutex_;
  std::array<std::vector<Span>, kNumNames> spans_;
  std::array<std::vector<std::size_t>, kNumNames> order_;
  std::set<std::thread::id> threads_;
  int clock_ = 0;
  int num_at_work_ = 0;
  int most_at_once_ = 0;
};

/// Everything that docs/architecture.md promises of what waits for what.
void expect_order(const Diary& diary, std::size_t num_frames) {
  std::vector<std::size_t> in_order(num_frames);
  std::iota(in_order.begin(), in_order.end(), std::size_t{0});
  for (const Name name : kSerial) {
    EXPECT_EQ(diary.order(name), in_order) << "stage " << name;
  }
  EXPECT_EQ(diary.order(kRead).size(), num_frames);
  const auto expect_before = [&](Name first, std::size_t i, Name second, std::size_t k) {
    EXPECT_LT(diary.at(first, i).end, diary.at(second, k).begin)
        << "stage " << second << " of frame " << k << " before the end of stage " << first
        << " of frame " << i;
  };
  for (std::size_t k = 0; k < num_frames; ++k) {
    expect_before(kRead, k, kPrepare, k);
    expect_before(kPrepare, k, kTrack, k);
    expect_before(kTrack, k, kLocalize, k);
    expect_before(kLocalize, k, kOptimize, k);
    if (k > 0) {
      for (const Name name : kSerial) {
        expect_before(name, k - 1, name, k);
      }
      expect_before(kLocalize, k - 1, kTrack, k);
      expect_before(kOptimize, k - 1, kLocalize, k);
    }
    if (k >= kMaxInFlight) {
      expect_before(kOptimize, k - kMaxInFlight, kRead, k);
    }
  }
}

TEST(FrameScheduler, KeepsTheOrderWhateverAStageTakesForAnyNumberOfThreads) {
  constexpr std::size_t kNumFrames = 300;
  for (const int num_threads : {1, 2, 3, 4, 8}) {
    for (const int longest_nap_us : {0, 200}) {
      SCOPED_TRACE(std::to_string(num_threads) + " threads, naps of " +
                   std::to_string(longest_nap_us) + " us");
      Diary diary(kNumFrames, longest_nap_us);
      run_stages(diary.stages(), kNumFrames, num_threads);
      expect_order(diary, kNumFrames);
      EXPECT_LE(diary.most_at_once(), num_threads);
      EXPECT_LE(diary.threads().size(), static_cast<std::size_t>(num_threads));
    }
  }
}

TEST(FrameScheduler, WithOneThreadAllRunsInTheCallingOne) {
  Diary diary(20, 0);
  run_stages(diary.stages(), 20, 1);
  EXPECT_EQ(diary.threads(), std::set{std::this_thread::get_id()});
  EXPECT_LT(diary.at(kOptimize, 3).end, diary.at(kRead, 4).begin);  // no work is done ahead
}

TEST(FrameScheduler, EndsWhereAStreamDoes) {
  for (const int num_threads : {1, 2, 4, 8}) {
    for (const std::size_t num_there : {0U, 1U, 5U, 6U, 7U, 50U}) {
      SCOPED_TRACE(std::to_string(num_threads) + " threads, frames " + std::to_string(num_there));
      Diary diary(num_there, 200);
      diary.set_num_there(num_there);
      run_stages(diary.stages(), std::numeric_limits<std::size_t>::max(), num_threads);
      expect_order(diary, num_there);
    }
  }
}

TEST(FrameScheduler, HasNothingToDoWithoutFrames) {
  for (const int num_threads : {1, 4}) {
    Diary diary(0, 0);
    run_stages(diary.stages(), 0, num_threads);
    EXPECT_TRUE(diary.threads().empty());
  }
}

/// Both sides wait for each other: only side by side do they get on.
class Meeting {
 public:
  explicit Meeting(int num_guests) : num_missing_(num_guests) {}
  void attend() {
    std::unique_lock lock(mutex_);
    --num_missing_;
    changed_.notify_all();
    EXPECT_TRUE(changed_.wait_for(lock, kPatience, [this] { return num_missing_ <= 0; }))
        << "they cannot run side by side";
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  int num_missing_;
};

TEST(FrameScheduler, FollowsAFrameBesideFinishingTheOneBefore) {
  Diary diary(10, 0);
  Meeting meeting(2);
  FrameStages stages = diary.stages();
  stages.track = [&](std::size_t k) {
    if (k == 5) {
      meeting.attend();
    }
  };
  stages.optimize = [&](std::size_t k) {
    if (k == 4) {
      meeting.attend();
    }
    return true;
  };
  run_stages(stages, 10, 2);
}

TEST(FrameScheduler, ReadsAndPreparesAheadBesideTheRest) {
  Diary diary(10, 0);
  Meeting meeting(5);  // frame 2 is tracked, 1 optimized, 3 prepared, 4 and 5 read
  FrameStages stages = diary.stages();
  const auto meet_at = [&](std::size_t frame) {
    return [&meeting, frame](std::size_t k) {
      if (k == frame) {
        meeting.attend();
      }
    };
  };
  stages.track = meet_at(2);
  stages.optimize = [meet = meet_at(1)](std::size_t k) {
    meet(k);
    return true;
  };
  stages.prepare = meet_at(3);
  stages.read = [four = meet_at(4), five = meet_at(5)](std::size_t k) {
    four(k);
    five(k);
    return true;
  };
  run_stages(stages, 10, 5);
}

TEST(FrameScheduler, EndsAtTheFrameWhoseFinishSaysSo) {
  for (const int num_threads : {1, 2, 4}) {
    Diary diary(50, 50);
    FrameStages stages = diary.stages();
    stages.optimize = [&](std::size_t k) {
      diary.record(kOptimize, k);
      return k < 7;
    };
    run_stages(stages, 50, num_threads);
    EXPECT_EQ(diary.order(kOptimize), (std::vector<std::size_t>{0, 1, 2, 3, 4, 5, 6, 7}));
    EXPECT_LE(diary.order(kLocalize).size(), 8U);
    EXPECT_LE(diary.order(kRead).size(), 7 + kMaxInFlight);
  }
}

TEST(FrameScheduler, ThrowsAgainWhatAStageThrows) {
  constexpr std::size_t kNumFrames = 30;
  for (const int num_threads : {1, 2, 4}) {
    for (int bad = kRead; bad < kNumNames; ++bad) {
      for (const std::size_t bad_frame : {std::size_t{0}, std::size_t{9}, kNumFrames - 1}) {
        Diary diary(kNumFrames, 20);
        const auto work = [&](Name name, std::size_t k) {
          diary.record(name, k);
          if (name == bad && k == bad_frame) {
            throw std::runtime_error("stage " + std::to_string(bad));
          }
        };
        const FrameStages stages = {.read = [&](std::size_t k) { return work(kRead, k), true; },
                                    .prepare = [&](std::size_t k) { work(kPrepare, k); },
                                    .track = [&](std::size_t k) { work(kTrack, k); },
                                    .localize = [&](std::size_t k) { work(kLocalize, k); },
                                    .optimize =
                                        [&](std::size_t k) {
                                          work(kOptimize, k);
                                          return true;
                                        }};
        EXPECT_THROW(run_stages(stages, kNumFrames, num_threads), std::runtime_error)
            << "stage " << bad << ", " << num_threads << " threads";
        EXPECT_LE(diary.order(kOptimize).size(), bad_frame + 1);
      }
    }
  }
}

/// Threads with nothing else to do help with a loop of OpenCV, and no others.
TEST(FrameScheduler, SharesTheLoopsOfOpenCvAmongItsThreads) {
  const ThreadScope limit(3);
  Meeting meeting(3);
  std::mutex mutex;
  std::set<std::thread::id> threads;
  std::vector<int> num_done(1000, 0);
  std::atomic<int> num_threads_told = 0;
  Diary diary(1, 0);
  FrameStages stages = diary.stages();
  stages.track = [&](std::size_t) {
    num_threads_told = cv::getNumThreads();
    cv::parallel_for_(cv::Range(0, static_cast<int>(num_done.size())), [&](const cv::Range& range) {
      EXPECT_LT(cv::getThreadNum(), 3);
      {
        const std::lock_guard lock(mutex);
        threads.insert(std::this_thread::get_id());
      }
      meeting.attend();
      for (int i = range.start; i < range.end; ++i) {
        ++num_done[static_cast<std::size_t>(i)];
      }
    });
    EXPECT_EQ(num_done, std::vector<int>(num_done.size(), 1));  // all of it, when the loop returns
  };
  run_stages(stages, 1, 3);
  EXPECT_EQ(threads.size(), 3U);
  EXPECT_EQ(num_threads_told, 3);
  EXPECT_EQ(cv::getNumThreads(), 3);  // OpenCV's own again
}

TEST(FrameScheduler, NeverHasMoreThreadsThanAskedForInStagesAndTheirLoops) {
  for (const int num_threads : {1, 2, 4}) {
    const ThreadScope limit(num_threads);
    std::mutex mutex;
    std::set<std::thread::id> threads;
    std::array<std::atomic<int>, 5> sums{};
    const auto work = [&](Name name) {
      cv::parallel_for_(cv::Range(0, 64), [&](const cv::Range& range) {
        {
          const std::lock_guard lock(mutex);
          threads.insert(std::this_thread::get_id());
        }
        std::this_thread::sleep_for(20us);
        sums[name] += range.size();
      });
    };
    const FrameStages stages = {.read = [&](std::size_t) { return work(kRead), true; },
                                .prepare = [&](std::size_t) { work(kPrepare); },
                                .track = [&](std::size_t) { work(kTrack); },
                                .localize = [&](std::size_t) { work(kLocalize); },
                                .optimize =
                                    [&](std::size_t) {
                                      work(kOptimize);
                                      return true;
                                    }};
    run_stages(stages, 40, num_threads);
    EXPECT_LE(threads.size(), static_cast<std::size_t>(num_threads));
    for (const std::atomic<int>& sum : sums) {
      EXPECT_EQ(sum, 40 * 64);
    }
  }
}

TEST(FrameScheduler, ThrowsAgainWhatALoopOfOpenCvThrows) {
  const ThreadScope limit(3);
  Diary diary(5, 0);
  FrameStages stages = diary.stages();
  stages.localize = [&](std::size_t) {
    cv::parallel_for_(cv::Range(0, 100), [](const cv::Range& range) {
      if (range.start <= 70 && 70 < range.end) {
        throw std::runtime_error("in a loop");
      }
    });
  };
  EXPECT_THROW(run_stages(stages, 5, 3), std::runtime_error);
}

/// Each on threads of its own, the loops included.
TEST(FrameScheduler, RunsBesideAnother) {
  const ThreadScope limit(2);
  const auto run = [] {
    Diary diary(100, 50);
    FrameStages stages = diary.stages();
    std::atomic<int> sum = 0;
    stages.prepare = [&](std::size_t k) {
      cv::parallel_for_(cv::Range(0, 50), [&](const cv::Range& range) { sum += range.size(); });
      diary.record(kPrepare, k);
    };
    run_stages(stages, 100, 2);
    expect_order(diary, 100);
    EXPECT_EQ(sum, 100 * 50);
  };
  {
    const std::jthread other(run);
    run();
  }
}

}  // namespace
}  // namespace stemvo::pipeline
