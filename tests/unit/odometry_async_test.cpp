// SPDX-License-Identifier: MIT
#include <atomic>

#include "stemvo/async_odometry.hpp"
#include "support/small_drive.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

/// Everything a frame left, as far as it can be asked for.
struct Left {
  FrameResult result;
  std::vector<TrackedPoint> points;
  std::size_t num_landmarks = 0;
  double channel_sum = 0.0;
};

template <typename SomeOdometry>
Left left_by(const FrameResult& result, const SomeOdometry& odometry) {
  return {result, odometry.tracked_points(), odometry.landmarks_since(0).landmarks.size(),
          cv::sum(odometry.channel_image())[0]};
}

void expect_same(const std::vector<Left>& found, const std::vector<Left>& expected) {
  ASSERT_EQ(found.size(), expected.size());
  for (std::size_t k = 0; k < expected.size(); ++k) {
    const auto& [result, points, num_landmarks, channel_sum] = found[k];
    EXPECT_EQ(result.state, expected[k].result.state) << k;
    EXPECT_EQ(result.time_s, expected[k].result.time_s) << k;
    EXPECT_EQ(result.num_inliers, expected[k].result.num_inliers) << k;
    EXPECT_EQ(result.world_from_camera.matrix(), expected[k].result.world_from_camera.matrix())
        << k;
    EXPECT_EQ(num_landmarks, expected[k].num_landmarks) << k;
    EXPECT_EQ(channel_sum, expected[k].channel_sum) << k;
    ASSERT_EQ(points.size(), expected[k].points.size()) << k;
    for (std::size_t i = 0; i < points.size(); ++i) {
      EXPECT_EQ(points[i].uv, expected[k].points[i].uv) << k;
    }
  }
}

class Async : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    Odometry odometry = Odometry::create(frames().camera).value();
    for (std::size_t i = 0; i < frames().images.size(); ++i) {
      plain_.push_back(left_by(
          odometry.process(frames().images[i], frames().order, time_s(i)).value(), odometry));
    }
  }
  static const SmallFrames& frames() { return small_frames(); }
  static double time_s(std::size_t i) { return SmallFrames::time_s(i); }
  static Options with_threads(int threads) {
    Options options;
    options.threads = threads;
    return options;
  }
  static AsyncOdometry create(int threads, AsyncOdometry::Callback callback = {}) {
    return AsyncOdometry::create(frames().camera, with_threads(threads), {}, std::move(callback))
        .value();
  }
  static Status push(AsyncOdometry& odometry, std::size_t i) {
    return odometry.push(frames().images[i], frames().order, time_s(i));
  }
  static void push_all(AsyncOdometry& odometry) {
    for (std::size_t i = 0; i < frames().images.size(); ++i) {
      ASSERT_TRUE(push(odometry, i));
    }
  }

  static inline std::vector<Left> plain_;  ///< by Odometry
};

TEST_F(Async, TheCallbackSeesWhatProcessLeavesForAnyNumberOfThreads) {
  ASSERT_GT(plain_.back().num_landmarks, 20U);
  for (const int threads : {0, 1, 2, 4}) {
    std::optional<AsyncOdometry> odometry;
    std::vector<Left> found;
    std::thread::id caller;
    odometry = create(threads, [&](const FrameResult& result) {
      found.push_back(left_by(result, *odometry));
      caller = std::this_thread::get_id();
    });
    for (std::size_t i = 0; i < frames().images.size(); ++i) {
      cv::Mat image = frames().images[i].clone();
      ASSERT_TRUE(odometry->push(image, frames().order, time_s(i)));
      image.setTo(0);  // as a camera that writes the next one there
    }
    EXPECT_TRUE(odometry->finish());
    expect_same(found, plain_);
    EXPECT_EQ(caller == std::this_thread::get_id(), threads == 1);
  }
}

TEST_F(Async, NextGivesTheSameResultsToAnotherThread) {
  for (const int threads : {1, 3}) {
    AsyncOdometry odometry = create(threads);
    std::vector<Rigid3> poses;
    std::jthread taker([&] {
      std::size_t num_points = 0;
      while (const std::optional<FrameResult> result = odometry.next().value()) {
        poses.push_back(result->world_from_camera);
        num_points += odometry.tracked_points().size();  // of some frame: no race
        num_points += odometry.landmarks_since(0).landmarks.size();
      }
      EXPECT_GT(num_points, 0U);
    });
    push_all(odometry);
    EXPECT_TRUE(odometry.finish());
    taker.join();
    ASSERT_EQ(poses.size(), plain_.size());
    for (std::size_t i = 0; i < poses.size(); ++i) {
      EXPECT_EQ(poses[i].matrix(), plain_[i].result.world_from_camera.matrix());
    }
  }
}

/// Whoever pushes all before he takes any is not left waiting.
TEST_F(Async, ResultsWaitUntilTheyAreTaken) {
  AsyncOdometry odometry = create(2);
  push_all(odometry);
  EXPECT_EQ((*odometry.next())->state, FrameState::kFirst);
  EXPECT_TRUE(odometry.finish());
  std::size_t num_taken = 1;
  for (; odometry.next()->has_value(); ++num_taken) {
  }
  EXPECT_EQ(num_taken, frames().images.size());
  EXPECT_FALSE(odometry.next()->has_value());
  EXPECT_THAT(message_of(odometry.push(frames().images[0], frames().order, 1e6)),
              HasSubstr("after finish()"));
}

TEST_F(Async, AThousandResultsThatNobodyTakesAreEnough) {
  AsyncOdometry odometry =
      AsyncOdometry::create(
          {.fx_px = 60, .fy_px = 60, .cx_px = 40, .cy_px = 30, .width_px = 80, .height_px = 60},
          with_threads(1))
          .value();
  const cv::Mat dark = cv::Mat::zeros(60, 80, CV_8UC1);
  double now_s = 0.0;
  const auto push_next = [&] { return odometry.push(dark, PixelOrder::kGray, now_s += 0.1); };
  for (int i = 0; i < 1000; ++i) {
    ASSERT_TRUE(push_next()) << i;
  }
  EXPECT_THAT(message_of(push_next()), AllOf(HasSubstr("next()"), HasSubstr("1000 that wait")));
  ASSERT_TRUE(odometry.next());
  EXPECT_TRUE(push_next());
  EXPECT_FALSE(push_next());
  EXPECT_TRUE(odometry.finish());
  int num_taken = 1;
  for (; odometry.next()->has_value(); ++num_taken) {
  }
  EXPECT_EQ(num_taken, 1001) << "what was refused left nothing";
}

TEST_F(Async, AWrongFrameIsAnErrorOfPushAndChangesNothing) {
  std::vector<Left> found;
  std::optional<AsyncOdometry> odometry;
  odometry =
      create(2, [&](const FrameResult& result) { found.push_back(left_by(result, *odometry)); });
  for (std::size_t i = 0; i < frames().images.size(); ++i) {
    EXPECT_THAT(message_of(odometry->push(cv::Mat(7, 7, CV_8UC1), PixelOrder::kGray, 1e6)),
                AllOf(HasSubstr("image: expected"), HasSubstr("found 7x7")));
    ASSERT_TRUE(push(*odometry, i));
    EXPECT_THAT(message_of(push(*odometry, i)), HasSubstr("time: expected"));
  }
  EXPECT_TRUE(odometry->finish());
  expect_same(found, plain_);
}

TEST_F(Async, FinishThrowsWhatTheCallbackThrew) {
  for (const int threads : {1, 2}) {
    int num_called = 0;
    AsyncOdometry odometry = create(threads, [&](const FrameResult&) {
      if (++num_called == 3) {
        throw std::runtime_error("disk on fire");
      }
    });
    Status pushed;
    for (std::size_t i = 0; i < frames().images.size() && pushed; ++i) {
      pushed = push(odometry, i);
    }
    EXPECT_THAT(message_of(pushed), HasSubstr("finish() throws why"));
    EXPECT_THROW((void)odometry.finish(), std::runtime_error);
    EXPECT_EQ(num_called, 3);
  }
}

TEST_F(Async, WhatWouldWaitForItselfInTheCallbackIsAnError) {
  for (const int threads : {1, 2}) {
    std::optional<AsyncOdometry> odometry;
    std::vector<std::string> errors;
    odometry = create(threads, [&](const FrameResult&) {
      errors = {message_of(push(*odometry, 5)), message_of(odometry->finish()),
                message_of(odometry->reset()), message_of(odometry->next()),
                message_of(odometry->load_map("place.map"))};
    });
    ASSERT_TRUE(push(*odometry, 0));
    EXPECT_TRUE(odometry->finish());
    EXPECT_THAT(errors,
                ::testing::ElementsAre(HasSubstr("push"), HasSubstr("finish"), HasSubstr("reset"),
                                       HasSubstr("next"), HasSubstr("load_map")));
  }
}

TEST_F(Async, NorDoesAFrameWaitForItselfInItsLog) {
  Odometry odometry = Odometry::create(frames().camera, with_threads(1)).value();
  int num_lines = 0;
  odometry.set_log([&](LogLevel, const std::string&) {
    ++num_lines;
    odometry.reset();  // does nothing here
    EXPECT_THAT(message_of(odometry.process(frames().images[0], frames().order, 1e6)),
                HasSubstr("found one in it"));
  });
  for (std::size_t i = 0; i < frames().images.size(); ++i) {
    EXPECT_TRUE(odometry.process(frames().images[i], frames().order, time_s(i)));
  }
  EXPECT_GT(num_lines, 0);
}

TEST_F(Async, AfterAResetTheWorldIsNew) {
  for (const int threads : {1, 2}) {
    std::optional<AsyncOdometry> odometry;
    std::vector<Left> found;
    odometry = create(
        threads, [&](const FrameResult& result) { found.push_back(left_by(result, *odometry)); });
    for (std::size_t i = 0; i < 9; ++i) {
      ASSERT_TRUE(push(*odometry, frames().images.size() - 1 - i)) << "times fall: " << i;
      ASSERT_TRUE(odometry->reset());
    }
    ASSERT_EQ(found.size(), 9U) << "frames before it are done";
    found.clear();
    push_all(*odometry);
    EXPECT_TRUE(odometry->finish());
    expect_same(found, plain_);
    EXPECT_THAT(message_of(odometry->reset()), HasSubstr("after finish()"));
  }
}

TEST_F(Async, OneThatWasMovedFromIsAnError) {
  AsyncOdometry odometry = create(2);
  const AsyncOdometry other = std::move(odometry);
  EXPECT_THAT(message_of(push(odometry, 0)), HasSubstr("moved"));
  EXPECT_THAT(message_of(odometry.finish()), HasSubstr("moved"));
  EXPECT_THAT(message_of(odometry.reset()), HasSubstr("moved"));
  EXPECT_FALSE(odometry.next());
  EXPECT_TRUE(odometry.landmarks_since(0).landmarks.empty() && odometry.keyframes().empty() &&
              odometry.tracked_points().empty() && odometry.channel_image().empty());
}

TEST_F(Async, IsDestroyedInTheMiddle) {
  for (const int threads : {1, 2}) {
    for (const std::size_t num_frames : {0U, 1U, 2U, 7U, 12U}) {
      std::atomic<std::size_t> num_called = 0;
      AsyncOdometry odometry = create(threads, [&](const FrameResult&) { ++num_called; });
      for (std::size_t i = 0; i < num_frames; ++i) {
        ASSERT_TRUE(push(odometry, i));
      }
      {
        const AsyncOdometry dropped = std::move(odometry);
      }
      EXPECT_LE(num_called, num_frames);
    }
  }
}

}  // namespace
}  // namespace stemvo
