// SPDX-License-Identifier: MIT
// The command in this process, under the sanitizers too.
#include "calibration/calibrate.hpp"
#include "dataset/camera_file.hpp"
#include "dataset/frame_source.hpp"
#include "geometry/distortion.hpp"
#include "support/test.hpp"
#include "synth/synth.hpp"

namespace stemvo {
namespace {

/// A small walk, its turns ten times a second.
class CalibrateSequence : public ::testing::Test {
 protected:
  static constexpr int kNumFrames = 100;

  CalibrateSequence() {
    EXPECT_TRUE(render_synthetic_drive(folder_.path(), {.walk = true,
                                                        .num_frames = kNumFrames,
                                                        .render = {.walk_rate_hz = 10.0},
                                                        .width_px = 320,
                                                        .height_px = 240}));
    request_.sequence_dir = folder_ / "sequences/00";
    request_.out_file = folder_ / "refined.txt";
  }
  [[nodiscard]] std::string error() const { return message_of(calibrate_sequence(request_)); }

  TempFolder folder_;
  CalibrationRequest request_;
};

TEST_F(CalibrateSequence, FindsThePrincipalPointAndKeepsOtherRows) {
  const Camera truth = open_kitti(request_.sequence_dir, {}).value().camera;
  request_.calibration =
      folder_.file("wrong.txt", fmt::format("P1: 9 0 8 7 0 9 8 0 0 0 1 0\n"
                                            "P2: {0} 0 {1} 0 0 {0} {2} 0 0 0 1 0\n"
                                            "Tr: 1 0 0 0 0 1 0 0 0 0 1 0\n",
                                            truth.fx_px, truth.cx_px + 4.0, truth.cy_px - 3.0));
  const auto report = calibrate_sequence(request_);
  EXPECT_TRUE(report->written);
  EXPECT_GE(report->num_keyframes, 10U);
  EXPECT_GE(report->num_landmarks, 100U);
  EXPECT_NEAR(report->refined.cx_px, truth.cx_px, 1.5);
  EXPECT_NEAR(report->refined.cy_px, truth.cy_px, 1.5);
  EXPECT_THAT(format_calibration_table(*report),
              AllOf(HasSubstr("focal length"), HasSubstr("sigma"), HasSubstr("k1")));
  EXPECT_THAT(read_all(request_.out_file), AllOf(HasSubstr("P1: 9 0 8 7"), HasSubstr("Tr: 1 0 0")));
  request_.calibration = request_.out_file;
  EXPECT_THAT(error(), HasSubstr("no input"));
}

TEST_F(CalibrateSequence, StoppedItWritesNothing) {
  const auto report = calibrate_sequence(request_, [](std::size_t done, std::size_t total) {
    EXPECT_EQ(total, std::size_t{kNumFrames});
    return done < 5;
  });
  EXPECT_TRUE(report->interrupted);
  EXPECT_FALSE(fs::exists(request_.out_file));
}

TEST_F(CalibrateSequence, TooFewFramesAndBrokenOnes) {
  request_.frames = FrameRangeRequest{0, 2};
  EXPECT_THAT(error(), AllOf(HasSubstr("that move"), HasSubstr("2 frames")));
  fs::resize_file(request_.sequence_dir / "image_2/000003.png", 50);
  request_.frames.reset();
  const auto report = calibrate_sequence(request_);
  ASSERT_FALSE(report->warnings.empty());
  EXPECT_THAT(report->warnings[0], HasSubstr("000003.png"));
}

// The same images as a folder with a camera file, whose form the result has.
TEST_F(CalibrateSequence, ARecordingGetsACameraFile) {
  const Camera truth = open_kitti(request_.sequence_dir, {}).value().camera;
  request_.sequence_dir = folder_ / "sequences/00/image_2";
  request_.frames = FrameRangeRequest{0, 60};
  request_.camera_file = folder_.file(
      "camera.yaml", fmt::format("image_width: {}\nimage_height: {}\nintrinsics: [{}, {}, {}, {}]\n"
                                 "distortion_model: none\nrate_hz: 10\n",
                                 truth.width_px, truth.height_px, 1.05 * truth.fx_px,
                                 1.05 * truth.fy_px, truth.cx_px, truth.cy_px));
  request_.rate_hz = 25.0;
  const auto report = calibrate_sequence(request_);
  ASSERT_TRUE(report->written);
  EXPECT_THAT(report->warnings, Contains(HasSubstr("rate_hz goes before it")));
  const auto file = dataset::read_camera_file(request_.out_file);
  EXPECT_NEAR(file->camera.fx_px / truth.fx_px, 1.0, 0.02);
  EXPECT_NEAR(file->camera.fx_px, report->refined.fx_px, 1e-3);
  EXPECT_EQ(file->camera.distortion, Distortion::kRadialTangential);
  EXPECT_EQ(file->rate_hz, 10.0);
}

TEST(RefinedLens, ShowsTheWorldAsTheRefinedViewDoes) {
  Camera lens{400.0, 402.0, 330.0, 235.0, 640, 480};
  lens.distortion = Distortion::kRadialTangential;
  lens.distortion_coefficients = {-0.28, 0.07, 0.0002, 0.00002, 0.0};
  const Camera view = undistorted_camera(lens).value();
  IntrinsicsDelta nothing = IntrinsicsDelta::Zero();
  EXPECT_NEAR(refined_lens(lens, view, nothing).fx_px, lens.fx_px, 1e-6);
  IntrinsicsDelta change;
  change << 3.0, -2.0, 0.02, 0.01, -0.003;
  const Camera refined = refined_lens(lens, view, change);
  for (const Eigen::Vector2d& xy : {Eigen::Vector2d(0.5, 0.3), Eigen::Vector2d(-0.4, 0.1)}) {
    const double r_sq = xy.squaredNorm();
    const Eigen::Vector2d bent = xy * (1.0 + r_sq * (change[3] + r_sq * change[4]));
    const Eigen::Vector2d seen(view.fx_px * (1.0 + change[2]) * bent.x() + view.cx_px + change[0],
                               view.fy_px * (1.0 + change[2]) * bent.y() + view.cy_px + change[1]);
    const Eigen::Vector2d in_frame = source_pixel(lens, view, seen);
    const Eigen::Vector2d ours = refined.project(distort(refined, xy).homogeneous());
    EXPECT_LE((ours - in_frame).norm(), 0.3);
  }
}

TEST_F(CalibrateSequence, WhatIsNotDeterminedStaysAsGiven) {
  ASSERT_TRUE(render_synthetic_drive(
      folder_ / "straight",
      {.num_frames = 25, .width_px = 310, .height_px = 94}));  // one run, hardly a turn
  request_.sequence_dir = folder_ / "straight/sequences/00";
  const auto report = calibrate_sequence(request_);
  EXPECT_FALSE(report->written);
  EXPECT_EQ(report->parameters[0].refined, report->parameters[0].given);
  EXPECT_THAT(format_calibration_table(*report), HasSubstr("undetermined"));
  EXPECT_FALSE(fs::exists(request_.out_file));
}

}  // namespace
}  // namespace stemvo
