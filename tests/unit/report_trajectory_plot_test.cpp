// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

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

/// One tag of an XML file. (std::regex does not compile without warnings under the sanitizers.)
struct Tag {
  std::string name;
  std::map<std::string, std::string> attributes;
  bool closes = false;    ///< </name>
  bool is_empty = false;  ///< <name/>
};

/// Reads the tag at `i`, which is behind its '<', and moves behind its '>'. False: not well-formed.
bool read_tag(const std::string& xml, std::size_t& i, Tag& tag) {
  const auto skip = [&](const char* characters) {
    i = std::min(xml.find_first_not_of(characters, i), xml.size());
  };
  const auto word = [&](const char* stop) {
    const std::size_t begin = i;
    i = std::min(xml.find_first_of(stop, i), xml.size());
    return xml.substr(begin, i - begin);
  };
  tag = Tag();
  tag.closes = xml[i] == '/';
  i += tag.closes ? 1 : 0;
  tag.name = word(" \n/>");
  for (skip(" \n"); i < xml.size() && xml[i] != '/' && xml[i] != '>'; skip(" \n")) {
    const std::string key = word("= >");
    if (xml.compare(i, 2, "=\"") != 0) {
      return false;
    }
    i += 2;
    tag.attributes[key] = word("\"<");
    if (i >= xml.size() || xml[i++] != '"') {
      return false;
    }
  }
  tag.is_empty = i < xml.size() && xml[i] == '/';
  i += tag.is_empty ? 1 : 0;
  return i < xml.size() && xml[i++] == '>' && !tag.name.empty();
}

/// All tags; a failed expectation where one is not well-formed or not closed in its order.
std::vector<Tag> read_xml(const std::string& xml) {
  std::vector<Tag> tags;
  std::vector<std::string> open;
  std::size_t i = xml.starts_with("<?xml") ? xml.find("?>") : 0;
  for (i = xml.find('<', i); i != std::string::npos; i = xml.find('<', i)) {
    Tag tag;
    if (!read_tag(xml, ++i, tag) || (tag.closes && (open.empty() || open.back() != tag.name))) {
      ADD_FAILURE() << "not well-formed before byte " << i;
      return {};
    }
    if (tag.closes) {
      open.pop_back();
    } else if (!tag.is_empty) {
      open.push_back(tag.name);
    }
    tags.push_back(tag);
  }
  EXPECT_TRUE(open.empty()) << "not closed: " << open.size();
  return tags;
}

/// Points of the one path of that stroke width; a failed expectation when there is not exactly one.
std::vector<Eigen::Vector2d> polyline(const std::vector<Tag>& tags, const std::string& width) {
  std::vector<std::vector<Eigen::Vector2d>> found;
  for (const Tag& tag : tags) {
    const auto value = [&](const char* key) {
      const auto it = tag.attributes.find(key);
      return it == tag.attributes.end() ? std::string() : it->second;
    };
    // cairo 1.16 writes a style, 1.18 attributes.
    const bool has_width = value("stroke-width") == width ||
                           value("style").find("stroke-width:" + width + ";") != std::string::npos;
    if (tag.name != "path" || !has_width) {
      continue;
    }
    std::string data = value("d");
    std::replace_if(data.begin(), data.end(), [](char c) { return c == 'M' || c == 'L'; }, ' ');
    std::istringstream words(data);
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

/// The last pixels of each row stay paper: a legend that ran over the edge would be cut there.
TEST(TrajectoryPng, ALongLegendFitsTheFigure) {
  const TempFolder folder;
  TrajectoryPlot plot = corner();
  plot.title.clear();
  for (const char* name :
       {"median (stopped after 1000 frames)", "worst (stopped after 6 frames)"}) {
    plot.others.push_back({name, {at(0, 0), at(1, 20), at(0, 30)}});
  }
  ASSERT_TRUE(write_trajectory_png(folder / "a.png", plot));
  const cv::Mat image = cv::imread((folder / "a.png").string(), cv::IMREAD_GRAYSCALE);
  ASSERT_FALSE(image.empty());
  EXPECT_EQ(cv::countNonZero(image.colRange(image.cols - 12, image.cols) != 255), 0);
}

TEST(TrajectorySvg, HasBothPathsWithEqualAxes) {
  const TempFolder folder;
  ASSERT_TRUE(write_trajectory_svg(folder / "a.svg", corner()));
  const std::vector<Tag> svg = read_xml(read_all(folder / "a.svg"));
  ASSERT_FALSE(svg.empty());
  EXPECT_EQ(svg.front().name, "svg");
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
