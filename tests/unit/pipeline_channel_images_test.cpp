// SPDX-License-Identifier: MIT
#include "pipeline/channel_images.hpp"
#include "support/small_drive.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

class ChannelImages : public SmallDrive {};

TEST_F(ChannelImages, OfTheInputLayer) {
  ChannelImagesRequest request;
  request.sequence_dir = sequence_;
  request.out_dir = folder_.path() / "out";
  request.config.stem.model = "input_layer";
  request.frames = FrameRangeRequest{2, 4};
  const auto written = write_channel_images(request);
  EXPECT_EQ(*written, 2U * (1 + 3 + 1));
  EXPECT_TRUE(fs::exists(request.out_dir / "000003_filter_002.png"));
  EXPECT_TRUE(fs::exists(request.out_dir / "000002_sheet.png"));
  request.filters = FrameRangeRequest{2, 4};
  EXPECT_THAT(message_of(write_channel_images(request)),
              ::testing::HasSubstr("expected filters inside 0:3, found --filters 2:4"));
}

}  // namespace
}  // namespace stemvo
