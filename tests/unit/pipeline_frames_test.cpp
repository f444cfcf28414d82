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

}  // namespace
}  // namespace stemvo
