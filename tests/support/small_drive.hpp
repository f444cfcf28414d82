// SPDX-License-Identifier: MIT
#pragma once

#include "dataset/frame_source.hpp"
#include "stemvo/odometry.hpp"
#include "support/test.hpp"
#include "synth/synth.hpp"

namespace stemvo::testing {

/// A few small frames of a rendered street with ground truth, for tests inside one process.
class SmallDrive : public ::testing::Test {
 protected:
  static constexpr int kNumFrames = 24;

  SmallDrive() {
    const SyntheticDriveOptions options{.num_frames = kNumFrames, .width_px = 310, .height_px = 94};
    EXPECT_TRUE(render_synthetic_drive(folder_.path(), options));
  }

  TempFolder folder_;
  std::filesystem::path sequence_ = folder_.path() / "sequences/00";
};

/// Its frames, rendered once in a process.
struct SmallFrames {
  Camera camera;
  std::vector<cv::Mat> images;
  PixelOrder order = PixelOrder::kGray;

  [[nodiscard]] static double time_s(std::size_t i) { return 0.1 * static_cast<double>(i); }
};
inline const SmallFrames& small_frames() {
  struct Drive : SmallDrive {
    void TestBody() override {}
    [[nodiscard]] SmallFrames read() const {
      const FrameSource sequence = open_kitti(sequence_, {}).value();
      SmallFrames frames{sequence.camera, {}};
      for (std::size_t i = 0; i < sequence.size(); ++i) {
        frames.images.push_back(sequence.read(i).value());
      }
      frames.order = frames.images.front().channels() == 1 ? PixelOrder::kGray : PixelOrder::kRgb;
      return frames;
    }
  };
  static const SmallFrames frames = Drive().read();
  return frames;
}

}  // namespace stemvo::testing
