// SPDX-License-Identifier: MIT
#include "report/frame_image.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

constexpr int kBand_px = 40;
constexpr int kGap_px = 4;

cv::Mat gray_frame() { return {100, 400, CV_8UC1, cv::Scalar(90)}; }

/// A quarter of the frame's size, as a 4 x 4 filter with stride 4 gives it.
ChannelImage coarse_channel() {
  return {cv::Mat(25, 100, CV_8UC1, cv::Scalar(120)),
          {Eigen::Vector2d(4.0, 4.0), Eigen::Vector2d(1.5, 1.5)}};
}

Matches one_match(const Eigen::Vector2d& prev, const Eigen::Vector2d& cur) {
  return {{prev}, {cur}, {-1}, 1};
}

bool is_gray(const cv::Vec3b& rgb) { return rgb[0] == rgb[1] && rgb[1] == rgb[2]; }
bool is_red(const cv::Vec3b& rgb) { return rgb[0] > 150 && rgb[1] < 80 && rgb[2] < 80; }

/// Smallest box around the pixels that are not gray.
cv::Rect colored_box(const cv::Mat& rgb) {
  std::vector<cv::Mat> channels;
  cv::split(rgb, channels);
  return cv::boundingRect((channels[0] != channels[1]) | (channels[1] != channels[2]));
}

TEST(FrameImage, WritingLeavesTheImageAloneAndKeepsItsColours) {
  const cv::Mat rgb(20, 30, CV_8UC3, cv::Scalar(200, 100, 50));
  const TempFolder folder;
  ASSERT_TRUE(write_image(folder.path() / "rgb.png", rgb).has_value());
  EXPECT_EQ(rgb.at<cv::Vec3b>(3, 4), cv::Vec3b(200, 100, 50));
  const cv::Mat read = cv::imread((folder.path() / "rgb.png").string());
  EXPECT_EQ(read.at<cv::Vec3b>(3, 4), cv::Vec3b(50, 100, 200));  // OpenCV reads B, G, R
}

TEST(FrameImage, ShowsInputAboveChannelAtTheSameWidth) {
  const cv::Mat image = draw_frame_image(gray_frame(), coarse_channel(), {}, {});
  ASSERT_EQ(image.type(), CV_8UC3);
  EXPECT_EQ(image.size(), cv::Size(400, 100 + kGap_px + 100));
  EXPECT_EQ(image.at<cv::Vec3b>(50, 200), cv::Vec3b(90, 90, 90));
  EXPECT_EQ(image.at<cv::Vec3b>(100 + kGap_px + 50, 200), cv::Vec3b(120, 120, 120));
}

TEST(FrameImage, DrawsMatchesAtTheSamePositionOnBoth) {
  const cv::Mat image =
      draw_frame_image(gray_frame(), coarse_channel(), one_match({200, 30}, {230, 60}), {1});
  const cv::Rect above = colored_box(image.rowRange(0, 100));
  const cv::Rect below = colored_box(image.rowRange(100 + kGap_px, image.rows));
  for (const cv::Rect& box : {above, below}) {
    EXPECT_NEAR(box.x, 200, 3);
    EXPECT_NEAR(box.y, 30, 3);
    EXPECT_NEAR(box.br().x, 231, 4);
    EXPECT_NEAR(box.br().y, 61, 4);
  }
}

TEST(FrameImage, ColoursInliersByFlowAndOutliersRed) {
  const Matches match = one_match({50, 50}, {90, 50});
  const auto pixel = [&](const std::vector<char>& mask) {
    const cv::Mat image = draw_frame_image(gray_frame(), coarse_channel(), match, mask);
    return image.at<cv::Vec3b>(50, 70);
  };
  EXPECT_TRUE(is_red(pixel({0})));
  EXPECT_TRUE(is_red(pixel({})));
  EXPECT_FALSE(is_red(pixel({1})));
  EXPECT_FALSE(is_gray(pixel({1})));
  // A short flow has another colour than the longest.
  const Matches three{
      {{50, 20}, {50, 50}, {50, 80}}, {{51, 20}, {90, 50}, {90, 80}}, {-1, -1, -1}, 3};
  const cv::Mat image = draw_frame_image(gray_frame(), coarse_channel(), three, {1, 1, 1});
  const cv::Vec3d slow = image.at<cv::Vec3b>(20, 51);
  const cv::Vec3d fast = image.at<cv::Vec3b>(50, 70);
  EXPECT_GT(cv::norm(slow - fast), 100.0);
}

TEST(FrameImage, SurvivesWhatAnUnreadableFrameGives) {
  const Matches outside{{{-50, 0}, {0, 3}, {5, 500}}, {{900, 5}, {5, 5}, {5, -5}}, {}, 3};
  EXPECT_FALSE(draw_frame_image({}, coarse_channel(), outside, {1, 1, 0}).empty());
  EXPECT_FALSE(draw_frame_image(gray_frame(), {}, outside, {}).empty());
  EXPECT_FALSE(draw_frame_image({}, {}, {}, {}).empty());
  EXPECT_THROW((void)draw_frame_image(gray_frame(), {}, outside, {1}), std::logic_error);
}

TEST(FrameImage, StandsUnderItsCaption) {
  const cv::Mat image = draw_under_caption(cv::Mat(100, 400, CV_8UC3, cv::Scalar(10, 20, 200)),
                                           "\u00fc\xff", "right");
  ASSERT_EQ(image.size(), cv::Size(400, kBand_px + 100));
  EXPECT_EQ(image.at<cv::Vec3b>(kBand_px + 5, 5), cv::Vec3b(10, 20, 200));
  EXPECT_EQ(describe_flow(one_match({50, 50}, {90, 50}), {1}),
            "flow 0 (blue) to 40 px (yellow), outliers red");
  EXPECT_EQ(describe_flow({}, {}), "");
}

TEST(FrameImage, SaysThatItCannotBeWritten) {
  EXPECT_THAT(message_of(write_image("/nonexistent/a.png", gray_frame())),
              HasSubstr("/nonexistent/a.png: cannot write"));
  EXPECT_ANY_THROW(static_cast<void>(write_image("/tmp/a.png", {}))) << "no pixels";
}

TEST(ChannelSheet, ShowsEveryChannelUnderItsName) {
  // Each channel is a ramp of its own sign, so each image has black and white in it.
  cv::Mat ramp(25, 100, CV_32FC1);
  for (int i = 0; i < 2500; ++i) {
    ramp.at<float>(i / 100, i % 100) = static_cast<float>(i % 100) * 0.001F;
  }
  const cv::Mat flat(25, 100, CV_8UC1, cv::Scalar(77));
  const cv::Mat sheet = draw_channel_sheet(gray_frame(), {ramp, -ramp, flat},
                                           {"input", "filter 0", "filter 1", "filter 2"});
  ASSERT_EQ(sheet.type(), CV_8UC3);
  // 4 images of 4:1 make one column or two of them; here one is nearest to the sheet's shape.
  EXPECT_EQ(sheet.cols, 400 + 2 * 16);
  const auto gray_at = [&](int row, int x) {
    return static_cast<int>(sheet.at<cv::Vec3b>(16 + row * (100 + 34 + 8) + 50, 16 + x)[0]);
  };
  EXPECT_EQ(gray_at(0, 200), 90);
  EXPECT_LT(gray_at(1, 5), 20);
  EXPECT_GT(gray_at(1, 395), 235);
  EXPECT_GT(gray_at(2, 5), 235);
  EXPECT_LT(gray_at(2, 395), 20);
  EXPECT_EQ(gray_at(3, 200), 77);
  EXPECT_THROW((void)draw_channel_sheet(gray_frame(), {ramp}, {"input"}), std::logic_error);
}

TEST(ChannelSheet, HoldsManyFiltersAndDeadOnes) {
  std::vector<cv::Mat> channels(255, cv::Mat(25, 100, CV_32FC1, cv::Scalar(3.0F)));
  std::vector<std::string> captions(256, "filter");
  const cv::Mat sheet = draw_channel_sheet(gray_frame(), channels, captions);
  EXPECT_LE(sheet.cols, 2000);
  EXPECT_LE(sheet.rows, 4000);
}

}  // namespace
}  // namespace stemvo
