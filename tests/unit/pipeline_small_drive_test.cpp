// SPDX-License-Identifier: MIT
#include "evaluation/trajectory.hpp"
#include "pipeline/run.hpp"
#include "support/small_drive.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

/// A street whose last frames are dark, and a gyro that is right before them.
class GyroRun : public SmallDrive {
 protected:
  static constexpr int kNumSeen = 18;

  void SetUp() override {
    truth_ = read_kitti_trajectory(folder_.path() / "poses/00.txt").value();
    std::ifstream times(sequence_ / "times.txt");
    for (double time_s = 0.0; times >> time_s;) {
      times_s_.push_back(time_s);
    }
    for (int i = kNumSeen; i < kNumFrames; ++i) {
      const std::string file = (sequence_ / fmt::format("image_2/{:06}.png", i)).string();
      ASSERT_TRUE(cv::imwrite(file, cv::Mat::zeros(94, 310, CV_8UC3)));
    }
  }

  /// The true rates are off by `seen_off`; in the dark the gyro says `dark`. All in rad/s.
  [[nodiscard]] fs::path write_gyro(const Eigen::Vector3d& seen_off,
                                    const Eigen::Vector3d& dark) const {
    const fs::path file = folder_.path() / "gyro.csv";
    std::ofstream out(file);
    for (std::size_t i = 1; i < times_s_.size(); ++i) {
      const Eigen::AngleAxisd turn((truth_[i - 1].inverse() * truth_[i]).rotation);
      const double rad_per_s = turn.angle() / (times_s_[i] - times_s_[i - 1]);
      const Eigen::Vector3d rate =
          i < kNumSeen ? Eigen::Vector3d(rad_per_s * turn.axis() + seen_off) : dark;
      for (const double time_s : {times_s_[i - 1] + 1e-4, times_s_[i] - 1e-4}) {
        out << fmt::format("{:.6f} {} {} {}\n", time_s, rate.x(), rate.y(), rate.z());
      }
    }
    return file;
  }
  /// From the last frame seen to the last one.
  [[nodiscard]] Eigen::Quaterniond turn_in_the_dark(const std::optional<fs::path>& gyro) const {
    RunRequest request;
    request.sequence_dir = sequence_;
    request.out_dir = folder_.path() / "out";
    request.num_threads = 1;
    request.gyro = gyro;
    EXPECT_TRUE(run_sequence(request).value().written);
    const auto poses = read_kitti_trajectory(request.out_dir / "trajectory_kitti.txt").value();
    return (poses[kNumSeen - 1].inverse() * poses.back()).rotation;
  }

  Trajectory truth_;
  std::vector<double> times_s_;
};

TEST_F(GyroRun, TurnsALostCameraIfItWasRightBefore) {
  const Eigen::Vector3d in_the_dark(0.0, 0.5, 0.1);
  const double dark_s = times_s_.back() - times_s_[kNumSeen - 1];
  const Eigen::Quaterniond said = so3_exp(dark_s * in_the_dark);
  const Eigen::Quaterniond without = turn_in_the_dark({});
  const Eigen::Vector3d none = Eigen::Vector3d::Zero();
  EXPECT_GT(without.angularDistance(said), 0.2);
  EXPECT_LT(turn_in_the_dark(write_gyro(none, in_the_dark)).angularDistance(said), 0.01);
  const Eigen::Vector3d off(0.0, 1.0, 0.0);
  EXPECT_LT(turn_in_the_dark(write_gyro(off, in_the_dark)).angularDistance(without), 0.02);
}

class ChannelImages : public SmallDrive {};

TEST_F(ChannelImages, OfTheInputLayer) {
  ChannelImagesRequest request;
  request.sequence_dir = sequence_;
  request.out_dir = folder_.path() / "out";
  request.config.stem.model = "input_layer";
  request.frames = FrameRangeRequest{2, 4};
  const auto written = write_channel_images(request);
  EXPECT_EQ(written->num_written, 2U * (1 + 3 + 1));
  EXPECT_THAT(written->warnings, IsEmpty());
  EXPECT_TRUE(fs::exists(request.out_dir / "000003_filter_002.png"));
  EXPECT_TRUE(fs::exists(request.out_dir / "000002_sheet.png"));
  request.filters = FrameRangeRequest{2, 4};
  EXPECT_THAT(message_of(write_channel_images(request)),
              ::testing::HasSubstr("expected filters inside 0:3, found --filters 2:4"));
  request.filters = FrameRangeRequest{0, 1};
  request.sequence_dir = sequence_ / "image_2";
  request.camera_file = folder_.file("camera.yaml",
                                     "resolution: [310, 94]\nintrinsics: [180, 180, 154, 46]\n"
                                     "distortion_model: none\n");
  EXPECT_THAT(write_channel_images(request)->warnings,
              Contains(HasSubstr("30 frames per second are taken for granted")));
}

}  // namespace
}  // namespace stemvo
