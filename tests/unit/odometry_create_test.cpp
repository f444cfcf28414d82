// SPDX-License-Identifier: MIT
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "stemvo/odometry/odometry.hpp"
#include "support/synthetic_scene.hpp"
#include "support/tiny_stem.hpp"

namespace stemvo {
namespace {

TEST(OdometryCreate, AModelThatCannotTakeTheFramesIsAnErrorBeforeWork) {
  const testing::TempFolder folder;
  testing::write_models(folder, testing::kFixed4);  // takes frames of 48x32 only
  Config config;
  config.stem.model = (folder.path() / "fixed_k4s4.onnx").string();
  config.stem.sampling_px = 4;
  const auto odometry = Odometry::create(config, testing::kitti_camera(), folder.path());
  ASSERT_FALSE(odometry.has_value());
  EXPECT_THAT(odometry.error().message, ::testing::HasSubstr("fixed_k4s4.onnx"));
  EXPECT_THAT(odometry.error().message, ::testing::HasSubstr("found 1241x376"));
}

TEST(OdometryCreate, AFrameSmallerThanTheKernelIsAnError) {
  Config config;
  Camera camera = testing::kitti_camera();
  camera.width_px = 3;
  camera.height_px = 2;
  const auto odometry = Odometry::create(config, camera, STEMVO_SOURCE_DIR "/models");
  ASSERT_FALSE(odometry.has_value());
  EXPECT_THAT(odometry.error().message, ::testing::HasSubstr("found 3x2"));
}

}  // namespace
}  // namespace stemvo
