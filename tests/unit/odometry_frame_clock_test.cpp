// SPDX-License-Identifier: MIT
#include "odometry/frame_clock.hpp"
#include "stemvo/odometry.hpp"
#include "support/small_drive.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

TEST(FrameClock, AnyTwoClocksCountTheSameMicroseconds) {
  for (const double first_s : {0.0, 1'400'000'000.1, 1'764'172'412.789}) {
    FrameClock clock;
    for (int i = 0; i < 1000; ++i) {
      const double passed_s = 0.033367 * i;
      EXPECT_EQ(clock.advance(first_s + passed_s), whole_us(passed_s)) << first_s << ", " << i;
    }
    EXPECT_EQ(clock.since_first(first_s - 0.5), -0.5);
  }
}

TEST(FrameClock, TimesRiseWhateverTheirSize) {
  for (const double first_s : {-1e17, 0.0, 1e9}) {
    FrameClock clock;
    double last_s = clock.advance(first_s);
    EXPECT_EQ(last_s, 0.0);
    for (const double given_s : {1e9 + 1e-6, 1e9 + 2e-6, 1e9 + 1.0}) {
      const double now_s = clock.advance(given_s);
      EXPECT_GT(now_s, last_s) << first_s;
      last_s = now_s;
    }
  }
}

/// The poses where times begin at `first_s`, with a speed between frames.
std::vector<FrameResult> run_from(double first_s) {
  const SmallFrames& frames = small_frames();
  Odometry odometry = Odometry::create(frames.camera).value();
  std::vector<FrameResult> results;
  for (std::size_t i = 0; i < frames.images.size(); ++i) {
    const double time_s = first_s + frames.time_s(i);
    EXPECT_TRUE(odometry.add_speed(time_s - 0.03, 8.0, 0.2));
    results.push_back(odometry.process(frames.images[i], frames.order, time_s).value());
    EXPECT_EQ(results.back().time_s, time_s);
  }
  return results;
}

TEST(FrameClock, SecondsSince1970GiveTheSamePath) {
  const std::vector<FrameResult> expected = run_from(0.0);
  const std::vector<FrameResult> found = run_from(1'764'172'412.789);
  for (std::size_t i = 0; i < expected.size(); ++i) {
    EXPECT_EQ(found[i].world_from_camera.matrix(), expected[i].world_from_camera.matrix()) << i;
    EXPECT_EQ(found[i].scale_sigma, expected[i].scale_sigma) << i;
  }
}

}  // namespace
}  // namespace stemvo
