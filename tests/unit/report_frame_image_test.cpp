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

TEST(ChannelSheet, ShowsEveryChannelUnderItsName) {
  std::vector<cv::Mat> images = {gray_frame()};
  for (const int gray : {20, 200, 77}) {
    images.emplace_back(25, 100, CV_8UC1, cv::Scalar(gray));
  }
  const cv::Mat sheet = draw_sheet(images, {"input", "filter 0", "filter 1", "filter 2"});
  ASSERT_EQ(sheet.type(), CV_8UC3);
  // 4 images of 4:1 make one column or two of them; here one is nearest to the sheet's shape.
  EXPECT_EQ(sheet.cols, 400 + 2 * 16);
  for (const auto& [row, gray] : {std::pair(0, 90), {1, 20}, {2, 200}, {3, 77}}) {
    EXPECT_EQ(sheet.at<cv::Vec3b>(16 + row * (100 + 34 + 8) + 50, 16 + 200)[0], gray);
  }
  images.resize(256, gray_frame());
  const cv::Mat large = draw_sheet(images, std::vector<std::string>(256, "filter"));
  EXPECT_LE(large.cols, 2000);
  EXPECT_LE(large.rows, 4000);
}

Rigid3 at(double x, double z) { return {Eigen::Quaterniond::Identity(), {x, 0.0, z}}; }

/// 40 m ahead, then 30 m to the right; the truth goes 50 m ahead in a slight bend .
TrajectoryPlot corner() {
  TrajectoryPlot plot;
  plot.title = "Sequence 03 \u2013 gr\u00fcn & <b>";
  plot.subtitle = "offset 1.0 m";
  plot.estimate = {at(0, 0), at(0, 40), at(30, 40), at(30, 41)};
  plot.ground_truth = Trajectory{at(0, 0), at(3, 25), at(0, 50)};
  return plot;
}

/// The pixels within so many levels of an RGB colour.
cv::Mat mask_of(const cv::Mat& image, const cv::Scalar& rgb, double levels) {
  cv::Mat mask;
  cv::inRange(image, rgb - cv::Scalar::all(levels), rgb + cv::Scalar::all(levels), mask);
  return mask;
}

/// The box around the pixels of an RGB colour within the axes.
cv::Rect box_of(const cv::Mat& image, const cv::Scalar& rgb) {
  const cv::Point corner(155, 185);
  constexpr int kLabels_px = 120;  // below the axes
  const cv::Rect axes(corner, cv::Point(image.cols, image.rows - kLabels_px));
  return cv::boundingRect(mask_of(image(axes), rgb, 0.0));
}

TEST(TrajectoryImage, HasBothPathsWithEqualAxes) {
  const cv::Mat image = draw_trajectory(corner());
  const cv::Rect estimate = box_of(image, {0, 114, 178});
  const cv::Rect truth = box_of(image, {158, 158, 158});
  const double pixels_per_metre = estimate.width / 30.0;
  EXPECT_NEAR(truth.height / pixels_per_metre, 50.0, 2.0);
  EXPECT_NEAR((truth.br().y - estimate.y) / pixels_per_metre, 41.0, 2.0) << "forward is up";
  EXPECT_LT(std::abs(truth.x - estimate.x), 0.1 * estimate.width) << "both go to the right";
}

int count_color(const cv::Mat& image, const cv::Scalar& rgb) {
  return cv::countNonZero(mask_of(image, rgb, 3.0));
}

TEST(TrajectoryImage, ShowsBothPathsAndTheMarkers) {
  const cv::Mat image = draw_trajectory(corner());
  ASSERT_FALSE(image.empty());
  EXPECT_GE(image.cols, 1000);
  EXPECT_GT(count_color(image, {0, 114, 178}), 2000) << "estimate";
  EXPECT_GT(count_color(image, {158, 158, 158}), 2000) << "ground truth";
  EXPECT_GT(count_color(image, {0, 158, 115}), 300) << "start, in the plot and the legend";
  EXPECT_GT(count_color(image, {213, 94, 0}), 500) << "end, in the plot and the legend";

  TrajectoryPlot alone = corner();
  alone.ground_truth.reset();
  // The rest are the soft edges of letters.
  EXPECT_LT(count_color(draw_trajectory(alone), {158, 158, 158}), 500);
}

TEST(TrajectoryImage, DrawsWhatIsThereOfOddTrajectories) {
  const std::vector<Trajectory> odd{
      {at(0, 0)},
      {at(5, 5), at(5, 5)},
      {at(0, 0), at(1e-9, 1e-9)},
      {at(0, 0), at(1e7, 1.0)},
      {at(0, 0), at(0, 1e5)},
  };
  for (const Trajectory& trajectory : odd) {
    TrajectoryPlot plot{"", "", trajectory, std::nullopt};
    EXPECT_FALSE(draw_trajectory(plot).empty());
  }
}

TEST(TrajectoryImage, SurvivesTextThatIsNotUtf8) {
  TrajectoryPlot plot = corner();
  plot.title = "bad \xff\xc3( \xed\xa0\x80 \n end \xe2\x82";
  EXPECT_FALSE(draw_trajectory(plot).empty());
}

}  // namespace
}  // namespace stemvo
