// SPDX-License-Identifier: MIT
#include <latch>
#include <mutex>

#include "odometry/odometry_loops.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

enum Stage { kFill, kPrepare, kTrack, kLocalize, kOptimize };
constexpr std::array kStages = {kFill, kPrepare, kTrack, kLocalize, kOptimize};

/// Notes when each stage begins and ends a frame. `at` is called in between.
class Notes {
 public:
  using At = std::function<void(Stage, std::size_t)>;
  explicit Notes(At at = nullptr) : at_(std::move(at)) {}

  [[nodiscard]] FrameStages stages() {
    return {.prepare = [this](std::size_t k) { note(kPrepare, k); },
            .track = [this](std::size_t k) { note(kTrack, k); },
            .localize = [this](std::size_t k) { note(kLocalize, k); },
            .optimize = [this](std::size_t k) { return note(kOptimize, k); }};
  }
  void fill(std::size_t k) { note(kFill, k); }
  [[nodiscard]] int begin(Stage stage, std::size_t k) const { return spans_.at({stage, k}).first; }
  [[nodiscard]] int end(Stage stage, std::size_t k) const { return spans_.at({stage, k}).second; }
  [[nodiscard]] std::size_t count(Stage stage) const {
    return static_cast<std::size_t>(
        std::ranges::count_if(spans_, [&](const auto& span) { return span.first.first == stage; }));
  }
  [[nodiscard]] const std::set<std::thread::id>& threads() const { return threads_; }

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

/// Pushes so many frames, or until the run ends.
void push(FrameLoops& loops, Notes& notes, std::size_t num_frames) {
  for (std::size_t i = 0; i < num_frames; ++i) {
    if (!loops.push([&](std::size_t k) { notes.fill(k); })) {
      return;
    }
  }
}

void run(Notes& notes, std::size_t num_frames, int num_threads) {
  FrameLoops loops(notes.stages(), num_threads);
  push(loops, notes, num_frames);
  loops.finish();
}

TEST(FrameLoops, KeepTheOrderWhateverAStageTakes) {
  constexpr std::size_t kNumFrames = 150;
  for (const int num_threads : {1, 2, 4}) {
    Notes notes(nap);
    run(notes, kNumFrames, num_threads);
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
                  notes.end(kOptimize, k - kMaxInFlight) < notes.begin(kFill, k))
          << "more frames at work than there is room for";
    }
  }
}

/// Each of the three waits for the others: without all three at a time the test would not end.
TEST(FrameLoops, TheThreeLoopsRunBesideEachOther) {
  std::latch all(3);
  Notes notes([&](Stage stage, std::size_t k) {
    if ((stage == kOptimize && k == 0) || (stage == kTrack && k == 1) ||
        (stage == kPrepare && k == 2)) {
      all.arrive_and_wait();
    }
  });
  run(notes, 6, 2);
  EXPECT_EQ(notes.threads().size(), 4U);  // this one fills
  EXPECT_EQ(notes.count(kOptimize), 6U);
}

TEST(FrameLoops, ThrowAgainWhatAStageThrows) {
  for (const int num_threads : {1, 2}) {
    for (const auto& [thrower, frame] : {std::pair(kPrepare, 11U),
                                         {kTrack, 11U},
                                         {kLocalize, 11U},
                                         {kOptimize, 0U},
                                         {kOptimize, 11U},
                                         {kOptimize, 99U}}) {
      Notes notes([&, bad = thrower, last = frame](Stage stage, std::size_t k) {
        nap(stage, k);
        if (stage == bad && k == last) {
          throw std::runtime_error("stage " + std::to_string(stage));
        }
      });
      try {
        run(notes, 100, num_threads);
        ADD_FAILURE() << "nothing was thrown";
      } catch (const std::runtime_error& error) {
        EXPECT_EQ(error.what(), "stage " + std::to_string(thrower));
      }
      EXPECT_LE(notes.count(kOptimize), frame + 1U);
    }
  }
}

}  // namespace
}  // namespace stemvo
