// SPDX-License-Identifier: MIT
#include "dataset/frame_source.hpp"
#include "evaluation/trajectory.hpp"
#include "pipeline/frame_pipeline.hpp"
#include "pipeline/run.hpp"
#include "support/small_drive.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

FrameResult process(PhasedOdometry& odometry, Frame frame) {
  odometry.track(std::move(frame));
  odometry.localize();
  return odometry.optimize();
}

/// A street; frames 4, 5 and the last one are no images.
class FramePipeline : public SmallDrive {
 protected:
  static bool is_broken(std::size_t i) { return i == 4 || i == 5 || i + 1 == kNumFrames; }

  FramePipeline() {
    for (const int i : {4, 5, kNumFrames - 1}) {
      std::ofstream(sequence_ / fmt::format("image_2/{:06}.png", i)) << "no image";
    }
  }
  [[nodiscard]] PhasedOdometry odometry() const {
    return PhasedOdometry::create(frames_.camera, config_).value();
  }

  Config config_;
  const FrameSource frames_ = open_kitti(sequence_, {}).value();
};

TEST_F(FramePipeline, AGyrosClockIsTheCamerasByItsShift) {
  FrameSource frames = frames_;
  frames.imu_from_camera_s = 0.25;
  RunRequest request;
  request.gyro = folder_.file("gyro.txt", "0.25 0 0 1\n0.75 0 0 1\n");
  const auto beside = pipeline::read_beside_frames(request, frames);
  EXPECT_EQ(beside->gyro.front().time_s, 0.0);
  EXPECT_EQ(beside->gyro.back().time_s, 0.5);
}

TEST_F(FramePipeline, GivesTheSamePosesAsOneFrameAfterTheOtherForAnyNumberOfThreads) {
  std::vector<FrameResult> expected;
  PhasedOdometry plain = odometry();
  for (std::size_t i = 0; i < frames_.size(); ++i) {
    const Expected<cv::Mat> frame = frames_.read(i);
    Frame missing;
    missing.time_s = frames_.time_s(i);
    expected.push_back(process(plain, frame ? plain.prepare(*frame, missing.time_s) : missing));
  }
  EXPECT_EQ(expected[4].state, FrameState::kNoImage);
  EXPECT_EQ(expected.back().state, FrameState::kNoImage);
  EXPECT_GT(expected[8].num_inliers, 50);
  for (const int num_threads : {1, 2, 4}) {
    config_.threads = num_threads;
    PhasedOdometry piped = odometry();
    std::size_t num_visited = 0;
    pipeline::run_frames(
        frames_, piped,
        [&](std::size_t i, const Expected<cv::Mat>& frame, const FrameResult& result) {
          EXPECT_EQ(i, num_visited++);
          EXPECT_EQ(frame.has_value(), !is_broken(i));
          EXPECT_EQ(result.state, expected[i].state) << i;
          EXPECT_EQ(result.num_inliers, expected[i].num_inliers) << i;
          EXPECT_EQ(result.world_from_camera.matrix(), expected[i].world_from_camera.matrix()) << i;
          EXPECT_EQ(piped.frames().matches().cur_uv.size(),
                    static_cast<std::size_t>(result.num_matches));
          EXPECT_FALSE(piped.frames().image().pixels.empty());
          return true;
        });
    EXPECT_EQ(num_visited, frames_.size()) << num_threads << " threads";
  }
}

TEST_F(FramePipeline, EndsWithItsVisitorHoweverShortTheRecording) {
  const auto visited = [&](const char* range, std::size_t last, bool throws) {
    const FrameSource frames =
        open_kitti(sequence_, {.frames = parse_frame_range(range).value()}).value();
    PhasedOdometry piped = odometry();
    std::size_t num = 0;
    const auto visit = [&](std::size_t i, const Expected<cv::Mat>&, const FrameResult&) {
      ++num;
      if (throws && i == last) {
        throw std::runtime_error("disk on fire");
      }
      return i != last;
    };
    if (throws) {
      EXPECT_THROW(pipeline::run_frames(frames, piped, visit), std::runtime_error);
    } else {
      pipeline::run_frames(frames, piped, visit);
    }
    return num;
  };
  EXPECT_EQ(visited("0:8", 2, false), 3U);
  EXPECT_EQ(visited("0:8", 0, true), 1U);
  EXPECT_EQ(visited("0:8", 7, true), 8U);  // the last one is finished after the loops have ended
  EXPECT_EQ(visited("0:1", 9, false), 1U);
  EXPECT_EQ(visited("0:2", 9, false), 2U);
  EXPECT_EQ(visited("0:3", 9, false), 3U);
}

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
