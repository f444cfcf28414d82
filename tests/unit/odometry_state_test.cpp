// SPDX-License-Identifier: MIT
// An odometry that goes on from another one's state gives what that one would have given.
#include <array>
#include <cstdint>
#include <cstring>
#include <ctime>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "config/config.hpp"
#include "dataset/sequence.hpp"
#include "odometry/phased_odometry.hpp"
#include "pipeline/frame_pipeline.hpp"
#include "support/temp_folder.hpp"
#include "synth/synth.hpp"

namespace stemvo {
namespace {

struct Variant {
  std::string name;
  std::vector<std::string> overrides;
};

void PrintTo(const Variant& variant, std::ostream* out) { *out << variant.name; }

class OdometryState : public ::testing::TestWithParam<Variant> {
 protected:
  static constexpr int kNumFrames = 30;
  /// Could not be read; the tracks end there and go on behind it.
  static bool is_broken(std::size_t frame) { return frame == 17; }

  [[nodiscard]] PhasedOdometry odometry() const {
    Config config;
    for (const std::string& text : GetParam().overrides) {
      EXPECT_TRUE(apply_override(config, text)) << text;
    }
    return pipeline::create_odometry(config, sequence_.camera(), STEMVO_SOURCE_DIR "/models")
        .value();
  }
  void track(PhasedOdometry& odometry, std::size_t frame) const {
    odometry.track(is_broken(frame) ? PreparedFrame()
                                    : odometry.prepare(sequence_.read(frame).value()));
  }
  /// All that is known after the frame, times left out.
  static std::string described(const FrameResult& r) {
    std::string text =
        fmt::format("{} {} {} {} {} {} {}", to_string(r.state), r.num_matches, r.num_inliers,
                    to_string(r.road), r.road_reason, r.scale_sigma.value_or(-1.0), r.camera.cx_px);
    const CameraSigma sigma = r.camera_sigma.value_or(CameraSigma());
    text += fmt::format(" {} {} {} {}", r.camera.fx_px, sigma.fx_px, sigma.cx_px, sigma.cy_px);
    const Matrix34d pose = r.world_from_camera.matrix();
    for (const double value : pose.reshaped()) {
      text += fmt::format(" {:a}", value);
    }
    return text;
  }

  [[nodiscard]] KittiSequence rendered() const {
    const SyntheticDriveOptions options{.num_frames = kNumFrames, .width_px = 310, .height_px = 94};
    EXPECT_TRUE(render_synthetic_drive(folder_.path(), options));
    return KittiSequence::open(folder_.path() / "sequences/00", {}).value();
  }

  testing::TempFolder folder_;
  KittiSequence sequence_ = rendered();
};

TEST_P(OdometryState, GoesOnAsIfItHadNotStopped) {
  PhasedOdometry whole = odometry();
  std::vector<std::string> states;
  std::vector<std::string> expected;
  for (std::size_t i = 0; i < std::size_t{kNumFrames}; ++i) {
    track(whole, i);
    states.push_back(whole.state());
    whole.localize();
    expected.push_back(described(whole.optimize()));
  }
  for (const std::size_t first : {0, 6, 17, 18, 19, 29}) {
    PhasedOdometry again = odometry();
    ASSERT_TRUE(again.set_state(states[first]));
    EXPECT_TRUE(again.state() == states[first]) << first;
    for (std::size_t i = first; i < std::size_t{kNumFrames}; ++i) {
      if (i > first) {
        track(again, i);
      }
      again.localize();
      ASSERT_EQ(described(again.optimize()), expected[i]) << "from " << first << ", frame " << i;
    }
    const Estimator& a = whole.frames().estimator();
    const Estimator& b = again.frames().estimator();
    const auto refined = a.refined_trajectory();
    ASSERT_EQ(b.refined_trajectory().size(), refined.size());
    for (std::size_t i = 0; i < refined.size(); ++i) {
      EXPECT_EQ(b.refined_trajectory()[i].matrix(), refined[i].matrix()) << first << ", " << i;
    }
    ASSERT_EQ(b.landmarks().size(), a.landmarks().size());
    for (std::size_t i = 0; i < a.landmarks().size(); ++i) {
      EXPECT_EQ(b.landmarks()[i].position, a.landmarks()[i].position);
      EXPECT_EQ(b.landmarks()[i].rgb, a.landmarks()[i].rgb);
    }
  }
}

/// Somebody changed it. Whatever is taken for a state can be gone on from: track ids have tracks,
/// frames are there, pixels lie in their image.
TEST_P(OdometryState, AForgedOneIsRefusedOrGoneOnFrom) {
  constexpr std::size_t kFrame = 24;
  PhasedOdometry whole = odometry();
  for (std::size_t i = 0; i < kFrame; ++i) {
    track(whole, i);
    whole.localize();
    static_cast<void>(whole.optimize());
  }
  track(whole, kFrame);
  const std::string state = whole.state();
  const auto number_at = [&](std::size_t at) {
    std::int32_t number = 0;
    std::memcpy(&number, state.data() + at, sizeof(number));
    return number;
  };
  // Of ids and sizes: most of a state is pixels and floats, which have no bytes like these.
  std::vector<std::size_t> places;
  for (std::size_t at = 0; at + sizeof(std::int32_t) <= state.size(); ++at) {
    if (number_at(at) > 255 && number_at(at) < 2000) {
      places.push_back(at);
    }
  }
  std::mt19937 random(11);
  int num_refused = 0;
  constexpr int kNumTrials = 100;
  for (int trial = 0; trial < kNumTrials; ++trial) {
    const std::size_t at = places[random() % places.size()];
    const std::array<std::int32_t, 6> numbers = {-1,      0,           number_at(at) + 1,
                                                 1000000, -2147483647, 2147483647};
    const std::int32_t number = numbers[random() % numbers.size()];
    std::string forged = state;
    std::memcpy(forged.data() + at, &number, sizeof(number));
    PhasedOdometry again = odometry();
    if (!again.set_state(forged)) {
      ++num_refused;
      continue;
    }
    EXPECT_NO_THROW({
      again.localize();
      static_cast<void>(again.optimize());
      for (std::size_t i = kFrame + 1; i < kFrame + 2; ++i) {
        track(again, i);
        again.localize();
        static_cast<void>(again.optimize());
      }
      static_cast<void>(again.frames().estimator().refined_trajectory());
      static_cast<void>(again.frames().estimator().landmarks());
    }) << number_at(at)
       << " at " << at << " made " << number;
  }
  EXPECT_GT(num_refused, kNumTrials / 5) << places.size();
}

/// Found while fuzzing: the rows, each of nothing, were counted.
TEST_P(OdometryState, AnImageOfNoColumnsIsRefused) {
  PhasedOdometry one = odometry();
  track(one, 0);
  std::string state = one.state();
  const std::array<std::int32_t, 2> size = {sequence_.camera().height_px,
                                            sequence_.camera().width_px};
  const std::array<std::int32_t, 2> forged = {2147483647, 0};
  const std::size_t at =
      state.find(std::string_view(reinterpret_cast<const char*>(size.data()), sizeof(size)));
  ASSERT_NE(at, state.npos);
  std::memcpy(state.data() + at, forged.data(), sizeof(forged));
  PhasedOdometry again = odometry();
  const std::clock_t start = std::clock();
  EXPECT_FALSE(again.set_state(state));
  EXPECT_LT(std::clock() - start, CLOCKS_PER_SEC / 4);
}

INSTANTIATE_TEST_SUITE_P(Options,
                         OdometryState,
                         ::testing::Values(Variant{"map", {"camera.refine=all"}},
                                           Variant{"klt",
                                                   {"features.method=klt", "scale.source=none"}},
                                           Variant{"orb", {"features.method=orb"}},
                                           Variant{"sift", {"features.method=sift"}},
                                           Variant{"two_frame", {"odometry.mode=two_frame"}}),
                         ::testing::PrintToStringParamName());

}  // namespace
}  // namespace stemvo
