// SPDX-License-Identifier: MIT
#include "report/frame_image.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

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
  EXPECT_THROW((void)draw_trajectory(TrajectoryPlot{}), std::logic_error);
}

}  // namespace
}  // namespace stemvo
