// SPDX-License-Identifier: MIT
#include <vector>

#include <gtest/gtest.h>

#include "pipeline/checkpoint.hpp"
#include "support/temp_folder.hpp"

namespace stemvo::pipeline {
namespace {

TEST(Checkpoint, HoldsWhatWasLearntOfTheCamera) {
  Drive drive;
  drive.frames.resize(2);
  drive.frames[1].camera = {700.0, 710.0, 600.5, 180.25, 1241, 376};
  drive.frames[0].camera = drive.frames[1].camera;
  drive.frames[1].camera_sigma = {3.5, 0.5, 0.75};
  const testing::TempFolder folder;
  const auto file = folder.file("checkpoint", pack(2, "odometry", drive, 1.5, "identity"));
  const auto read = read_checkpoint(file, "identity", 10);
  ASSERT_TRUE(read) << read.error().message;
  ASSERT_TRUE(read->has_value());
  const std::vector<FrameResult>& frames = (*read)->drive.frames;
  ASSERT_EQ(frames.size(), 2U);
  EXPECT_FALSE(frames[0].camera_sigma.has_value());
  ASSERT_TRUE(frames[1].camera_sigma.has_value());
  EXPECT_EQ(frames[1].camera_sigma->fx_px, 3.5);
  EXPECT_EQ(frames[1].camera_sigma->cx_px, 0.5);
  EXPECT_EQ(frames[1].camera_sigma->cy_px, 0.75);
  EXPECT_EQ(frames[1].camera.fy_px, 710.0);
}

}  // namespace
}  // namespace stemvo::pipeline
