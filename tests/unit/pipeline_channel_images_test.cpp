// SPDX-License-Identifier: MIT
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pipeline/channel_images.hpp"
#include "support/small_drive.hpp"

namespace stemvo {
namespace {

namespace fs = std::filesystem;

class ChannelImages : public testing::SmallDrive {};

TEST_F(ChannelImages, OfTheInputLayer) {
  ChannelImagesRequest request;
  request.sequence_dir = sequence_;
  request.out_dir = folder_.path() / "out";
  request.config.stem.model = "input_layer";
  request.frames = FrameRangeRequest{2, 4};
  const auto written = write_channel_images(request);
  ASSERT_TRUE(written) << written.error().message;
  EXPECT_EQ(*written, 2U * (1 + 3 + 1));
  EXPECT_TRUE(fs::exists(request.out_dir / "000003_filter_002.png"));
  EXPECT_TRUE(fs::exists(request.out_dir / "000002_sheet.png"));
  request.filters = FrameRangeRequest{2, 4};
  const auto outside = write_channel_images(request);
  ASSERT_FALSE(outside);
  EXPECT_THAT(outside.error().message,
              ::testing::HasSubstr("expected filters inside 0:3, found --filters 2:4"));
}

}  // namespace
}  // namespace stemvo
