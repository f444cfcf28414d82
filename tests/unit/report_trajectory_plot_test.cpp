// SPDX-License-Identifier: MIT
#include <cmath>
#include <limits>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "report/plot_layout.hpp"
#include "stemvo/report/trajectory_plot.hpp"
#include "support/temp_folder.hpp"

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

/// Points of the one path of that stroke width and no fill. Fails when there is not exactly one.
std::vector<Eigen::Vector2d> polyline(const std::string& svg, const std::string& width) {
  std::vector<std::vector<Eigen::Vector2d>> found;
  const std::regex path("<path[^>]*/>");
  for (std::sregex_iterator it(svg.begin(), svg.end(), path), end; it != end; ++it) {
    const std::string element = it->str();
    std::smatch data;
    const bool has_width = std::regex_search(
        element, std::regex("stroke-width(:|=\")" +
                            std::regex_replace(width, std::regex("\\."), "\\.") + "[;\"]"));
    if (!has_width || !std::regex_search(element, data, std::regex(" d=\"([^\"]*)\""))) {
      continue;
    }
    std::istringstream words(std::regex_replace(data[1].str(), std::regex("[ML]"), " "));
    std::vector<Eigen::Vector2d> points;
    for (double x = 0.0, y = 0.0; words >> x >> y;) {
      points.emplace_back(x, y);
    }
    if (points.size() > 2) {  // the legend's swatch has two
      found.push_back(points);
    }
  }
  EXPECT_EQ(found.size(), 1U) << "paths of width " << width;
  return found.empty() ? std::vector<Eigen::Vector2d>(4) : found.front();
}

/// Every opened element is closed, in order; attributes are quoted.
bool is_well_formed(const std::string& xml) {
  const std::regex tag(R"(<(/?)([A-Za-z:]+)((?:\s+[A-Za-z:-]+="[^"<]*")*)\s*(/?)>|<\?[^>]*\?>)");
  std::vector<std::string> open;
  std::size_t covered = 0;
  for (std::sregex_iterator it(xml.begin(), xml.end(), tag), end; it != end; ++it) {
    const auto begin = static_cast<std::size_t>(it->position());
    if (xml.substr(covered, begin - covered).find('<') != std::string::npos) {
      return false;  // something that is no tag
    }
    covered = begin + static_cast<std::size_t>(it->length());
    if (!(*it)[2].matched) {
      continue;
    }
    if ((*it)[1].length() > 0) {
      if (open.empty() || open.back() != (*it)[2].str()) {
        return false;
      }
      open.pop_back();
    } else if ((*it)[4].length() == 0) {
      open.push_back((*it)[2].str());
    }
  }
  return open.empty() && covered > 0;
}

TEST(TrajectorySvg, HasBothPathsWithEqualAxes) {
  const TempFolder folder;
  ASSERT_TRUE(write_trajectory_svg(folder / "a.svg", corner()));
  const std::string svg = read_all(folder / "a.svg");
  EXPECT_TRUE(is_well_formed(svg));
  const auto estimate = polyline(svg, "3.5");
  const auto truth = polyline(svg, "9");
  ASSERT_EQ(estimate.size(), 4U);
  ASSERT_EQ(truth.size(), 3U);
  const Eigen::Vector2d ahead = estimate[1] - estimate[0];
  const Eigen::Vector2d right = estimate[2] - estimate[1];
  EXPECT_NEAR(ahead.x(), 0.0, 0.01);
  EXPECT_LT(ahead.y(), 0.0) << "forward is up";
  EXPECT_GT(right.x(), 0.0) << "right is right";
  EXPECT_NEAR(-ahead.y() / 40.0, right.x() / 30.0, 1e-3) << "pixels per metre";
  EXPECT_NEAR((truth[0] - truth[2]).y() / 50.0, right.x() / 30.0, 1e-3);
  EXPECT_EQ(truth[0], estimate[0]);
}

TEST(TrajectorySvg, GivesTheSameBytesAgain) {
  const TempFolder folder;
  ASSERT_TRUE(write_trajectory_svg(folder / "a.svg", corner()));
  ASSERT_TRUE(write_trajectory_png(folder / "a.png", corner()));
  ASSERT_TRUE(write_trajectory_svg(folder / "b.svg", corner()));
  ASSERT_TRUE(write_trajectory_png(folder / "b.png", corner()));
  EXPECT_EQ(read_all(folder / "a.svg"), read_all(folder / "b.svg"));
  EXPECT_EQ(read_all(folder / "a.png"), read_all(folder / "b.png"));
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
  const cv::Mat picture = cv::imread((folder / "a.png").string());
  ASSERT_FALSE(picture.empty());
  EXPECT_GE(picture.cols, 1000);
  EXPECT_GT(count_color(picture, {0, 114, 178}), 2000) << "estimate";
  EXPECT_GT(count_color(picture, {158, 158, 158}), 2000) << "ground truth";
  EXPECT_GT(count_color(picture, {0, 158, 115}), 300) << "start, in the plot and the legend";
  EXPECT_GT(count_color(picture, {213, 94, 0}), 500) << "end, in the plot and the legend";

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
    ASSERT_TRUE(write_trajectory_svg(folder / "a.svg", plot));
    EXPECT_FALSE(cv::imread((folder / "a.png").string()).empty());
    EXPECT_EQ(read_all(folder / "a.svg").find("nan"), std::string::npos);
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
  EXPECT_FALSE(write_trajectory_svg("/dev/full", corner()));
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
