// SPDX-License-Identifier: MIT
#include "dataset/frame_source.hpp"
#include "pipeline/frame_pipeline.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

FrameResult process(PhasedOdometry& odometry, Frame frame) {
  odometry.track(std::move(frame));
  odometry.localize();
  return odometry.optimize();
}

/// A textured wall that comes nearer; frames 4, 5 and the last one are no images.
class FramePipeline : public ::testing::Test {
 protected:
  static constexpr int kNumFrames = 10;
  static bool is_broken(std::size_t i) { return i == 4 || i == 5 || i + 1 == kNumFrames; }

  void SetUp() override {
    const fs::path sequence = folder_ / "sequences/08";
    fs::create_directories(sequence / "image_0");
    std::ofstream(sequence / "calib.txt") << "P0: 200 0 159.5 0 0 200 79.5 0 0 0 1 0\n";
    std::ofstream times(sequence / "times.txt");
    cv::Mat wall(480, 960, CV_8UC1);
    cv::theRNG().state = 3;
    cv::randu(wall, 0, 256);
    cv::GaussianBlur(wall, wall, {}, 2.0);
    cv::normalize(wall, wall, 0, 255, cv::NORM_MINMAX);
    for (int i = 0; i < kNumFrames; ++i) {
      times << 0.1 * i << "\n";
      const fs::path file = sequence / fmt::format("image_0/{:06}.png", i);
      if (is_broken(static_cast<std::size_t>(i))) {
        std::ofstream(file) << "no image";
        continue;
      }
      const double scale = 0.5 + 0.02 * i;
      const cv::Matx23d map(scale, 0.02 * i, 159.5 - 479.5 * scale, 0, scale, 79.5 - 239.5 * scale);
      cv::Mat frame;
      cv::warpAffine(wall, frame, map, {320, 160}, cv::INTER_LINEAR);
      cv::imwrite(file.string(), frame);
    }
    times.close();
    config_.stem.model = "gray";
    sequence_.emplace(open_kitti(sequence, {}).value());
  }

  [[nodiscard]] PhasedOdometry odometry() const {
    return PhasedOdometry::create(sequence_->camera, config_).value();
  }

  Config config_;
  TempFolder folder_;
  std::optional<FrameSource> sequence_;
};

TEST_F(FramePipeline, GivesTheSamePosesAsOneFrameAfterTheOtherForAnyNumberOfThreads) {
  std::vector<FrameResult> expected;
  PhasedOdometry plain = odometry();
  for (std::size_t i = 0; i < sequence_->size(); ++i) {
    const Expected<cv::Mat> frame = sequence_->read(i);
    Frame missing;
    missing.time_s = sequence_->time_s(i);
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
        *sequence_, piped,
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
    EXPECT_EQ(num_visited, sequence_->size()) << num_threads << " threads";
  }
}

}  // namespace
}  // namespace stemvo
