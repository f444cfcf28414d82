// SPDX-License-Identifier: MIT
// A walk seen ten times a second, turning by 200 degrees a second: what a gyro's hints are worth
// beside the image's own turn.
#include "dataset/frame_source.hpp"
#include "stemvo/odometry.hpp"
#include "support/test.hpp"
#include "synth/synth.hpp"

namespace stemvo {
namespace {

/// Behind the first ten frames.
struct Outcome {
  double tracked = 0.0;         ///< share of the frames
  double inliers = 0.0;         ///< mean
  double turn_error_deg = 0.0;  ///< of the worst rotation between frames
};

class Hints : public ::testing::Test {
 protected:
  void SetUp() override {
    // It turns by 83 degrees a second at most: 22 between frames.
    const Status rendered =
        render_synthetic_drive(folder_ / "walk", {.walk = true,
                                                  .num_frames = 34,
                                                  .render = {.walk_rate_hz = 3.75},
                                                  .width_px = 480,
                                                  .height_px = 360});
    ASSERT_TRUE(rendered) << rendered.error().message;
  }

  /// One hint in `every` is off by `off`, all by the noise of a gyro.
  [[nodiscard]] Outcome run(bool has_hints,
                            const Eigen::Quaterniond& off = so3_exp({0, 0, 0}),
                            std::size_t every = 1) {
    const FrameSource walk = open_kitti(folder_ / "walk/sequences/00", {}).value();
    const Trajectory& truth = walk.ground_truth->poses;
    Odometry odometry = Odometry::create(walk.camera).value();
    std::mt19937 random(3);
    std::normal_distribution<double> noise_rad(0.0, 0.2 * kDeg);
    Outcome outcome;
    double num_frames = 0.0;
    Rigid3 before;
    for (std::size_t i = 0; i < walk.size(); ++i) {
      const Eigen::Quaterniond turn =
          i > 0 ? (truth[i - 1].inverse() * truth[i]).rotation : Eigen::Quaterniond::Identity();
      FrameHints hints;
      if (has_hints) {
        hints.prev_from_cur = turn * (i % every == 0 ? off : so3_exp({0, 0, 0})) *
                              so3_exp({noise_rad(random), noise_rad(random), noise_rad(random)});
      }
      const double time_s = 0.1 * static_cast<double>(i);
      const cv::Mat image = walk.read(i).value();
      const FrameResult frame = odometry.process(image, PixelOrder::kRgb, time_s, hints).value();
      const Rigid3 motion = before.inverse() * frame.world_from_camera;
      before = frame.world_from_camera;
      if (i >= 10) {
        num_frames += 1.0;
        outcome.tracked += is_measured(frame.state) ? 1.0 : 0.0;
        outcome.inliers += frame.num_inliers;
        outcome.turn_error_deg =
            std::max(outcome.turn_error_deg, motion.rotation.angularDistance(turn) / kDeg);
      }
    }
    outcome.tracked /= num_frames;
    outcome.inliers /= num_frames;
    return outcome;
  }

  TempFolder folder_;
};

TEST_F(Hints, KeepTrackOfFastTurnsAndWrongOnesCostNothing) {
  const Eigen::Quaterniond off = so3_exp(30.0 * kDeg * Eigen::Vector3d(0.6, 0.64, 0.48));
  const Outcome with = run(true);
  const Outcome without = run(false);
  const Outcome wrong = run(true, off);
  const Outcome some_wrong = run(true, off, 3);
  for (const Outcome& one : {with, without, wrong, some_wrong}) {
    std::cout << "tracked " << one.tracked << ", inliers " << one.inliers << ", worst turn off by "
              << one.turn_error_deg << " degrees\n";
  }
  EXPECT_GE(with.tracked, 0.98);
  EXPECT_LT(with.turn_error_deg, 1.0);
  // The whole images tell the turn as well.
  EXPECT_GT(with.inliers, 0.96 * without.inliers);
  EXPECT_GE(wrong.tracked, without.tracked);
  EXPECT_GE(some_wrong.tracked, without.tracked);
  EXPECT_GE(some_wrong.inliers, 0.98 * without.inliers);
  EXPECT_GE(wrong.inliers, 0.98 * without.inliers);
  EXPECT_LT(wrong.turn_error_deg, 1.1 * without.turn_error_deg);
}

}  // namespace
}  // namespace stemvo
