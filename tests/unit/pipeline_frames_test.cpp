// SPDX-License-Identifier: MIT
#include "dataset/frame_source.hpp"
#include "pipeline/frame_pipeline.hpp"
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

}  // namespace
}  // namespace stemvo
