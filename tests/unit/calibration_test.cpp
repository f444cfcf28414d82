// SPDX-License-Identifier: MIT
// The command in this process, under the sanitizers too.
#include <string>

#include <fmt/format.h>
#include <gmock/gmock.h>

#include "calibration/calibrate.hpp"
#include "dataset/sequence.hpp"
#include "support/temp_folder.hpp"
#include "synth/synth.hpp"

namespace stemvo {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

/// A small walk, its turns ten times a second.
class CalibrateSequence : public ::testing::Test {
 protected:
  static constexpr int kNumFrames = 100;

  CalibrateSequence() {
    EXPECT_TRUE(render_synthetic_drive(folder_.path(), {.walk = true,
                                                        .num_frames = kNumFrames,
                                                        .walk_rate_hz = 10.0,
                                                        .width_px = 320,
                                                        .height_px = 240}));
    request_.sequence_dir = folder_ / "sequences/00";
    request_.out_file = folder_ / "refined.txt";
  }
  [[nodiscard]] std::string error() const {
    const auto report = calibrate_sequence(request_);
    return report ? "no error" : report.error().message;
  }

  testing::TempFolder folder_;
  CalibrationRequest request_;
};

TEST_F(CalibrateSequence, FindsThePrincipalPointAndKeepsOtherRows) {
  const Camera truth = KittiSequence::open(request_.sequence_dir, {}).value().camera();
  request_.calibration =
      folder_.file("wrong.txt", fmt::format("P1: 9 0 8 7 0 9 8 0 0 0 1 0\n"
                                            "P2: {0} 0 {1} 0 0 {0} {2} 0 0 0 1 0\n"
                                            "Tr: 1 0 0 0 0 1 0 0 0 0 1 0\n",
                                            truth.fx_px, truth.cx_px + 4.0, truth.cy_px - 3.0));
  const auto report = calibrate_sequence(request_);
  ASSERT_TRUE(report) << report.error().message;
  EXPECT_TRUE(report->written);
  EXPECT_GE(report->num_runs, 1);
  EXPECT_NEAR(report->refined.cx_px, truth.cx_px, 1.5);
  EXPECT_NEAR(report->refined.cy_px, truth.cy_px, 1.5);
  EXPECT_THAT(format_calibration_table(*report),
              AllOf(HasSubstr("focal length"), HasSubstr("sigma"), HasSubstr("k1")));
  EXPECT_THAT(testing::read_all(request_.out_file),
              AllOf(HasSubstr("P1: 9 0 8 7"), HasSubstr("Tr: 1 0 0")));
  request_.calibration = request_.out_file;
  EXPECT_THAT(error(), HasSubstr("no input"));
}

TEST_F(CalibrateSequence, StoppedItWritesNothing) {
  const auto report = calibrate_sequence(request_, [](std::size_t done, std::size_t total) {
    EXPECT_EQ(total, std::size_t{kNumFrames});
    return done < 5;
  });
  ASSERT_TRUE(report) << report.error().message;
  EXPECT_TRUE(report->interrupted);
  EXPECT_FALSE(fs::exists(request_.out_file));
}

TEST_F(CalibrateSequence, TooFewFramesAndBrokenOnes) {
  request_.frames = FrameRangeRequest{0, 8};
  EXPECT_THAT(error(), AllOf(HasSubstr("that move"), HasSubstr("8 frames")));
  fs::resize_file(request_.sequence_dir / "image_2/000003.png", 50);
  request_.frames.reset();
  const auto report = calibrate_sequence(request_);
  ASSERT_TRUE(report) << report.error().message;
  ASSERT_FALSE(report->warnings.empty());
  EXPECT_THAT(report->warnings[0], HasSubstr("000003.png"));
}

TEST_F(CalibrateSequence, WhatIsNotDeterminedStaysAsGiven) {
  ASSERT_TRUE(render_synthetic_drive(
      folder_ / "straight",
      {.num_frames = 25, .width_px = 310, .height_px = 94}));  // one run, hardly a turn
  request_.sequence_dir = folder_ / "straight/sequences/00";
  const auto report = calibrate_sequence(request_);
  ASSERT_TRUE(report) << report.error().message;
  EXPECT_FALSE(report->written);
  EXPECT_EQ(report->parameters[0].refined, report->parameters[0].given);
  EXPECT_THAT(format_calibration_table(*report), HasSubstr("undetermined"));
  EXPECT_FALSE(fs::exists(request_.out_file));
}

}  // namespace
}  // namespace stemvo
