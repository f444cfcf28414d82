// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "report/plot_layout.hpp"
#include "report/trajectory_plot.hpp"
#include "support/temp_folder.hpp"

/// Asked by the leak checker where there is one: fontconfig keeps the fonts it has found to the end
/// of the process, once per face.
extern "C" const char* __lsan_default_suppressions();
extern "C" const char* __lsan_default_suppressions() { return "leak:libfontconfig"; }

namespace stemvo {
namespace {

using ::stemvo::testing::read_all;
using ::stemvo::testing::TempFolder;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

Rigid3 at(double x, double z) { return {Eigen::Quaterniond::Identity(), {x, 0.0, z}}; }

/// 40 m ahead, then 30 m to the right; the truth goes 50 m ahead in a slight bend (cairo drops
/// points within a straight line).
TrajectoryPlot corner() {
  TrajectoryPlot plot;
  plot.title = "Sequence 03 \u2013 gr\u00fcn & <b>";
  plot.subtitle = "offset 1.0 m";
  plot.estimate = {at(0, 0), at(0, 40), at(30, 40), at(30, 41)};
  plot.ground_truth = Trajectory{at(0, 0), at(3, 25), at(0, 50)};
  return plot;
}

TEST(TrajectoryPng, GivesTheSameBytesAgain) {
  const TempFolder folder;
  ASSERT_TRUE(write_trajectory_png(folder / "a.png", corner()));
  ASSERT_TRUE(write_trajectory_png(folder / "b.png", corner()));
  EXPECT_EQ(read_all(folder / "a.png"), read_all(folder / "b.png"));
}

/// Of an RGB colour, within the axes.
cv::Rect box_of(const cv::Mat& bgr, const cv::Vec3b& rgb) {
  cv::Mat mask;
  const cv::Scalar color(rgb[2], rgb[1], rgb[0]);
  const cv::Point corner(static_cast<int>(PlotLayout::kLeft_px) + 5,
                         static_cast<int>(PlotLayout::kTop_px) + 5);
  constexpr int kLabels_px = 120;  // below the axes
  cv::inRange(bgr(cv::Rect(corner, cv::Point(bgr.cols, bgr.rows - kLabels_px))), color, color,
              mask);
  return cv::boundingRect(mask);
}

TEST(TrajectoryPng, HasBothPathsWithEqualAxes) {
  const TempFolder folder;
  ASSERT_TRUE(write_trajectory_png(folder / "a.png", corner()));
  const cv::Mat image = cv::imread((folder / "a.png").string());
  const cv::Rect estimate = box_of(image, {0, 114, 178});
  const cv::Rect truth = box_of(image, {158, 158, 158});
  const double pixels_per_metre = estimate.width / 30.0;
  EXPECT_NEAR(truth.height / pixels_per_metre, 50.0, 2.0);
  EXPECT_NEAR((truth.br().y - estimate.y) / pixels_per_metre, 41.0, 2.0) << "forward is up";
  EXPECT_LT(std::abs(truth.x - estimate.x), 0.1 * estimate.width) << "both go to the right";
}

/// Pixels within a few levels of an RGB colour.
int count_color(const cv::Mat& bgr, const cv::Vec3b& rgb) {
  int count = 0;
  for (auto it = bgr.begin<cv::Vec3b>(); it != bgr.end<cv::Vec3b>(); ++it) {
    const bool is_near = std::abs((*it)[2] - rgb[0]) < 4 && std::abs((*it)[1] - rgb[1]) < 4 &&
                         std::abs((*it)[0] - rgb[2]) < 4;
    count += is_near ? 1 : 0;
  }
  return count;
}

TEST(TrajectoryPng, ShowsBothPathsAndTheMarkers) {
  const TempFolder folder;
  ASSERT_TRUE(write_trajectory_png(folder / "a.png", corner()));
  const cv::Mat image = cv::imread((folder / "a.png").string());
  ASSERT_FALSE(image.empty());
  EXPECT_GE(image.cols, 1000);
  EXPECT_GT(count_color(image, {0, 114, 178}), 2000) << "estimate";
  EXPECT_GT(count_color(image, {158, 158, 158}), 2000) << "ground truth";
  EXPECT_GT(count_color(image, {0, 158, 115}), 300) << "start, in the plot and the legend";
  EXPECT_GT(count_color(image, {213, 94, 0}), 500) << "end, in the plot and the legend";

  TrajectoryPlot alone = corner();
  alone.ground_truth.reset();
  ASSERT_TRUE(write_trajectory_png(folder / "b.png", alone));
  // What is left are the soft edges of letters.
  EXPECT_LT(count_color(cv::imread((folder / "b.png").string()), {158, 158, 158}), 500);
}

TEST(TrajectoryPng, DrawsWhatIsThereOfOddTrajectories) {
  const TempFolder folder;
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<Trajectory> odd{
      {at(0, 0)},
      {at(5, 5), at(5, 5)},
      {at(0, 0), at(1e-9, 1e-9)},
      {at(0, 0), at(1e7, 1.0)},
      {at(0, 0), at(0, 1e5)},
      {at(0, 0), at(kNan, 1.0), at(0, 2), at(0, 3)},
      {at(kNan, kNan)},
  };
  for (const Trajectory& trajectory : odd) {
    TrajectoryPlot plot{"", "", trajectory, std::nullopt};
    ASSERT_TRUE(write_trajectory_png(folder / "a.png", plot));
    EXPECT_FALSE(cv::imread((folder / "a.png").string()).empty());
  }
}

TEST(TrajectoryPng, SurvivesTextThatIsNotUtf8) {
  const TempFolder folder;
  TrajectoryPlot plot = corner();
  plot.title = "bad \xff\xc3( \xed\xa0\x80 \n end \xe2\x82";
  const Status written = write_trajectory_png(folder / "a.png", plot);
  EXPECT_TRUE(written) << written.error().message;
}

TEST(TrajectoryPng, SaysThatItCannotBeWritten) {
  const Status png = write_trajectory_png("/nonexistent/a.png", corner());
  ASSERT_FALSE(png);
  EXPECT_THAT(png.error().message, HasSubstr("/nonexistent/a.png: cannot write: "));
  EXPECT_FALSE(write_trajectory_png("/dev/full", corner()));
  EXPECT_THROW((void)write_trajectory_png("/tmp/a.png", TrajectoryPlot{}), std::logic_error);
}

TEST(PlotLayout, TicksAreRound) {
  EXPECT_DOUBLE_EQ(round_tick(1.0), 1.0);
  EXPECT_DOUBLE_EQ(round_tick(1.01), 2.0);
  EXPECT_DOUBLE_EQ(round_tick(30.0), 50.0);
  EXPECT_DOUBLE_EQ(round_tick(51.0), 100.0);
  EXPECT_DOUBLE_EQ(round_tick(0.003), 0.005);
  EXPECT_THAT(tick_positions(-21.0, 20.0, 10.0), ElementsAre(-20, -10, 0, 10, 20));
  EXPECT_EQ(tick_label(-20.0, 10.0), "\u221220");
  EXPECT_EQ(tick_label(0.1, 0.1), "0.1");
  EXPECT_EQ(tick_label(-0.0, 0.05), "0.00");
  EXPECT_EQ(tick_label(200.0, 200.0), "200");
}

TEST(PlotLayout, HoldsEveryPoseAndHasTicksOnBothAxes) {
  const Trajectory wide{at(-400, 3), at(400, 5)};
  const Trajectory tall{at(0, -100), at(1, 900)};
  for (const Trajectory* trajectory : {&wide, &tall}) {
    const PlotLayout layout = make_plot_layout({trajectory});
    for (const Rigid3& pose : *trajectory) {
      EXPECT_GT(pose.translation.x(), layout.min_x_m);
      EXPECT_LT(pose.translation.x(), layout.max_x_m());
      EXPECT_GT(pose.translation.z(), layout.min_z_m);
      EXPECT_LT(pose.translation.z(), layout.max_z_m());
    }
    EXPECT_GE(tick_positions(layout.min_x_m, layout.max_x_m(), layout.tick_m).size(), 3U);
    EXPECT_GE(tick_positions(layout.min_z_m, layout.max_z_m(), layout.tick_m).size(), 3U);
  }
}

}  // namespace
}  // namespace stemvo
