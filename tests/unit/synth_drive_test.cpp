// SPDX-License-Identifier: MIT
#include <cstring>

#include <opencv2/core/utility.hpp>

#include "dataset/frame_source.hpp"
#include "support/test.hpp"
#include "synth/synth.hpp"

namespace stemvo {
namespace {

class SyntheticDriveTest : public ::testing::Test {
 protected:
  void TearDown() override { cv::setNumThreads(-1); }
  static SyntheticDriveOptions small(int num_frames) {
    return {.num_frames = num_frames, .width_px = 160, .height_px = 48};
  }
  std::string all_bytes(const std::string& name, int num_frames) const {
    std::string bytes = read_all(root_ / name / "poses" / "00.txt");
    for (int i = 0; i < num_frames; ++i) {
      bytes += read_all(root_ / name / fmt::format("sequences/00/image_2/{:06}.png", i));
    }
    return bytes;
  }

  TempFolder folder_;
  const fs::path root_ = folder_.path();
};

TEST_F(SyntheticDriveTest, ShorterDriveReplacesALongerOne) {
  ASSERT_TRUE(render_synthetic_drive(root_ / "out", small(4)));
  ASSERT_TRUE(render_synthetic_drive(root_ / "out", small(2)));
  const auto sequence = open_kitti(root_ / "out" / "sequences" / "00");
  EXPECT_EQ(sequence->size(), 2U);
}

TEST_F(SyntheticDriveTest, IsASequenceWithExactTruth) {
  ASSERT_TRUE(render_synthetic_drive(root_ / "out", small(3)));
  const auto sequence = open_kitti(root_ / "out" / "sequences" / "00");
  ASSERT_EQ(sequence->size(), 3U);
  EXPECT_EQ(sequence->camera.width_px, 160);
  EXPECT_NEAR(sequence->camera.fx_px, 718.856 * 160 / 1241, 1e-9);
  EXPECT_EQ(sequence->camera.fx_px, sequence->camera.fy_px);
  EXPECT_DOUBLE_EQ(sequence->timestamps_s[2], 0.2);
  ASSERT_TRUE(sequence->ground_truth);
  const Rigid3 step = sequence->ground_truth->poses.at(1);
  EXPECT_GT(step.translation.z(), 0.75) << "8 m/s at least, forward";
  EXPECT_LT(step.translation.norm(), 1.25) << "12 m/s at most";
  EXPECT_EQ(sequence->read(2)->type(), CV_8UC3);
  std::ifstream poses(root_ / "out" / "poses" / "00.txt");
  std::string first;
  std::string word;
  std::getline(poses, first);
  EXPECT_THAT(first, ::testing::StartsWith("1.000000000000e+00 0.0"));
  poses >> word;
  EXPECT_GE(word.find('e') - word.find('.'), 13U) << "12 digits or more: " << word;
}

TEST_F(SyntheticDriveTest, SameBytesForAnyNumberOfThreadsAndOtherOnesForAnotherSeed) {
  SyntheticDriveOptions walk = small(3);
  walk.walk = true;
  SyntheticDriveOptions drive = small(3);  // with all that a drive may have
  drive.render.traffic = true;
  drive.render.exposure_s = 0.004;
  drive.render.readout_s = 0.01;
  drive.render.follows_light = true;
  for (SyntheticDriveOptions options : {walk, drive}) {
    cv::setNumThreads(1);
    ASSERT_TRUE(render_synthetic_drive(root_ / "one", options));
    cv::setNumThreads(2);
    ASSERT_TRUE(render_synthetic_drive(root_ / "two", options));
    EXPECT_TRUE(all_bytes("one", 3) == all_bytes("two", 3)) << options.walk;
    options.seed = 2;
    ASSERT_TRUE(render_synthetic_drive(root_ / "other", options));
    EXPECT_FALSE(all_bytes("one", 3) == all_bytes("other", 3)) << options.walk;
  }
}

TEST_F(SyntheticDriveTest, InterruptKeepsWhatIsDone) {
  cv::setNumThreads(1);
  const auto stop_after_two = [](int done, int total) {
    EXPECT_EQ(total, 6);
    return done < 2;
  };
  ASSERT_TRUE(render_synthetic_drive(root_ / "out", small(6), stop_after_two));
  const auto sequence = open_kitti(root_ / "out" / "sequences" / "00");
  EXPECT_EQ(sequence->size(), 2U);
  EXPECT_EQ(sequence->ground_truth->poses.size(), 2U);
}

/// Standing, turning on the spot, and a ring driven twice over itself.
TEST_F(SyntheticDriveTest, RendersAnyGivenPoses) {
  Trajectory poses;
  const auto add = [&](double heading_rad, double x, double z) {
    poses.emplace_back(Eigen::Quaterniond(Eigen::AngleAxisd(heading_rad, Eigen::Vector3d::UnitY())),
                       Eigen::Vector3d(x, 0.0, z));
  };
  add(0.0, 0.0, 0.0);
  add(0.0, 0.0, 0.0);
  add(0.5, 0.0, 0.0);
  add(0.0, 0.0, 1.0);
  for (int i = 0; i < 40; ++i) {
    const double angle = 4.0 * std::numbers::pi * i / 40;
    add(angle, 12.0 * (1.0 - std::cos(angle)), 1.0 + 12.0 * std::sin(angle));
  }
  SyntheticDriveOptions options = small(1000);
  options.write_depth = true;
  options.trajectory = root_ / "given.txt";
  ASSERT_TRUE(write_kitti_trajectory(*options.trajectory, poses));
  ASSERT_TRUE(render_synthetic_drive(root_ / "out", options));
  const auto sequence = open_kitti(root_ / "out" / "sequences" / "00");
  ASSERT_EQ(sequence->size(), poses.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Rigid3 error = sequence->ground_truth->poses.at(i).inverse() * poses[i];
    EXPECT_LT(error.translation.norm() + error.angle_rad(), 1e-8);
    // The last numbers of the file: the road before the car, which nothing may stand on.
    const std::string depth = read_all(root_ / fmt::format("out/sequences/00/depth/{:06}.npy", i));
    ASSERT_EQ(depth.size(), 128U + 4U * 160U * 48U);
    float z = 0.0F;
    std::memcpy(&z, depth.data() + depth.size() - 4U * 80U, sizeof(z));
    const double expected = 1.65 * 718.856 * 160 / 1241 / (47.0 - 185.2157 * 48 / 376);
    EXPECT_NEAR(static_cast<double>(z), expected, 0.12 * expected) << "frame " << i;
  }
}

TEST_F(SyntheticDriveTest, WhatIsNotRenderedStaysAsItIs) {
  const fs::path folder = root_ / "out" / "sequences" / "00";
  fs::create_directories(folder / "image_2");
  std::ofstream(folder / "image_2/000000.png") << "a real image";
  EXPECT_THAT(message_of(render_synthetic_drive(root_ / "out", small(2))),
              HasSubstr(folder.string()));
  EXPECT_EQ(read_all(folder / "image_2/000000.png"), "a real image");

  fs::remove_all(folder);
  fs::create_directories(root_ / "out" / "poses");
  std::ofstream(root_ / "out/poses/00.txt") << "real poses";
  EXPECT_FALSE(render_synthetic_drive(root_ / "out", small(2)));
  EXPECT_EQ(read_all(root_ / "out/poses/00.txt"), "real poses");
}

TEST_F(SyntheticDriveTest, BadInputIsOneLine) {
  const auto message = [&](const SyntheticDriveOptions& options, const fs::path& out) {
    return message_of(render_synthetic_drive(out, options));
  };
  SyntheticDriveOptions options = small(1);
  options.trajectory = root_ / "absent.txt";
  EXPECT_THAT(message(options, root_ / "out"), HasSubstr("absent.txt"));
  std::ofstream(root_ / "broken.txt") << "1 0 0 0 0 1 0 0 0 0 1\n";
  options.trajectory = root_ / "broken.txt";
  EXPECT_THAT(message(options, root_ / "out"), HasSubstr("broken.txt:1"));
  EXPECT_FALSE(fs::exists(root_ / "out")) << "nothing is written before the input is sound";
  std::ofstream(root_ / "file") << "x";
  EXPECT_THAT(message(small(1), root_ / "file"), HasSubstr((root_ / "file").string()));
}

}  // namespace
}  // namespace stemvo
