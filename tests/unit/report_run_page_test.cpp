// SPDX-License-Identifier: MIT
#include <nlohmann/json.hpp>

#include "evaluation/trajectory.hpp"
#include "html/page.hpp"
#include "report/run_page.hpp"
#include "support/report_content.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

using nlohmann::json;

/// 201 frames straight ahead, a metre each; the estimate is 1 % too long and drifts up.
class RunPageTest : public ::testing::Test {
 protected:
  RunPageTest() {
    truth_.emplace();
    for (int i = 0; i <= 200; ++i) {
      Rigid3 pose;
      pose.translation = {0.0, 0.0, 1.0 * i};
      truth_->poses.push_back(pose);
      truth_->frames.push_back(static_cast<std::size_t>(i));
      pose.translation = {0.0, -0.001 * i, 1.01 * i};
      estimate_.push_back(pose);
    }
    report_.num_frames = estimate_.size();
    report_.metrics = evaluate({estimate_, truth_->poses});
  }

  json content() {
    const std::string csv = "frame,state\n100,first\n";
    const TrajectoryPlot plot{"a drive", "numbers", estimate_, std::nullopt, "m"};
    EXPECT_TRUE(write_run_page(
        folder_ / "report.html",
        {plot, report_, csv, map_, truth_, {}, small_frames_, "key: value", "stemvo run"}));
    return report_content(read_all(folder_ / "report.html"));
  }

  TempFolder folder_;
  Trajectory estimate_;
  std::optional<MapPage> map_;
  std::optional<GroundTruth> truth_;
  MetricsReport report_;
  std::vector<html::CaptionedImage> small_frames_ = {{"frame 110", "\xff\xd8\x01", 10}};
};

TEST_F(RunPageTest, HoldsRowsPathsAndMetrics) {
  const json page = content();
  EXPECT_EQ(page["frames_csv"], "frame,state\n100,first\n");
  EXPECT_EQ(page["estimate"]["z"][100], 101.0);
  EXPECT_EQ(page["truth"]["z"][100], 100.0);
  EXPECT_EQ(page["truth"]["frames"][100], 100);
  EXPECT_EQ(page["metrics"]["frames"], 201);
  EXPECT_THAT(page["numbers"].get<std::string>(), HasSubstr("translation t_rel"));
  EXPECT_EQ(page["stages"], "");
  EXPECT_EQ(page["small_frames"][0]["row"], 10);
  EXPECT_EQ(page["configuration"], "key: value");
  EXPECT_EQ(page["command"], "stemvo run");
  // 1 % and a little of the climb, whatever the length; 100 m is the only length that fits in.
  EXPECT_EQ(page["segments"]["length_m"][0], 100.0);
  EXPECT_NEAR(page["segments"]["t_percent"][0].get<double>(), 100.0 * std::hypot(0.01, 0.001),
              0.03);
}

TEST_F(RunPageTest, HoldsTheMapsPathAndItsLoops) {
  EXPECT_TRUE(content()["map"].is_null());
  map_ = {truth_->poses, {{3, 180}}};
  const json page = content();
  EXPECT_EQ(page["map"]["z"][200], 200.0);
  EXPECT_EQ(page["map"]["loops"], json({{3, 180}}));
}

std::vector<std::size_t> rows_of(const SmallFrames& frames) {
  std::vector<std::size_t> rows;
  for (const html::CaptionedImage& kept : frames.images()) {
    rows.push_back(kept.row);
  }
  return rows;
}

TEST(SmallFrames, EveryTenthIsKeptAndFewerWhereTheyWouldTakeTooMuch) {
  const cv::Mat image(480, 640, CV_8UC3, cv::Scalar(30, 60, 90));
  SmallFrames all;
  for (std::size_t row = 0; row < 100; ++row) {
    all.add(row, 1000 + row, row == 50 ? cv::Mat() : image);
  }
  EXPECT_THAT(rows_of(all), ElementsAre(0, 10, 20, 30, 40, 60, 70, 80, 90));
  EXPECT_EQ(all.images().back().caption, "frame 1090");

  SmallFrames few(3 * all.images().back().jpeg.size());
  for (std::size_t row = 0; row < 100; ++row) {
    few.add(row, row, image);
  }
  EXPECT_THAT(rows_of(few), ElementsAre(0, 40, 80));
}

class HtmlPage : public ::testing::Test {
 protected:
  std::string written(const nlohmann::ordered_json& content) {
    EXPECT_TRUE(html::write_page(folder_ / "page.html", content));
    return read_all(folder_ / "page.html");
  }

  TempFolder folder_;
};

TEST_F(HtmlPage, TextFromOutsideStaysText) {
  const std::string hostile = "</script><script>alert(1)</script> {{plotly}} \"' \xff <!--";
  const std::string text = written({{"page", "run"}, {"title", hostile}});
  EXPECT_THAT(text, Not(HasSubstr("alert(1)</script>")));
  EXPECT_THAT(text, Not(HasSubstr("<!--\""))) << "a comment would swallow the rest";
  EXPECT_THAT(text, HasSubstr("{{plotly}}")) << "a place of the template is filled in once";
  EXPECT_EQ(report_content(text)["title"],
            "</script><script>alert(1)</script> {{plotly}} \"' \xef\xbf\xbd <!--");
}

TEST_F(HtmlPage, ImagesAreInIt) {
  EXPECT_EQ(html::images_json({{"frame 1", "\xff\xd8\x01", 7}})[0],
            (nlohmann::ordered_json{{"row", 7}, {"caption", "frame 1"}, {"jpeg", "/9gB"}}));
}

TEST_F(HtmlPage, PathsAreRoundedAndWhatIsNotFiniteIsNull) {
  std::vector<Rigid3> poses(2);
  poses[0].translation = {1.234567, -2.0, 3.0};
  poses[1].translation.x() = std::nan("");
  const std::string text = written({{"page", "run"}, {"path", html::path_json(poses)}});
  const nlohmann::json path = report_content(text)["path"];
  EXPECT_EQ(path["x"], nlohmann::json({1.23457, nullptr}));
  EXPECT_EQ(path["y"], nlohmann::json({-2.0, 0.0}));
  EXPECT_EQ(path["z"], nlohmann::json({3.0, 0.0}));
}

TEST_F(HtmlPage, NeedsNothingFromElsewhereAndNamesTheLicence) {
  const std::string text = written(nlohmann::ordered_json::object());
  for (const char* elsewhere : {"src=\"http", "href=\"http", "@import", "url("}) {
    EXPECT_THAT(text, Not(HasSubstr(elsewhere)));
  }
  EXPECT_THAT(text, HasSubstr("Plotly"));
  EXPECT_THAT(text, HasSubstr("Permission is hereby granted, free of charge"));
  EXPECT_THAT(text, Not(HasSubstr("@STEMVO"))) << "a place that the build fills in";
}

}  // namespace
}  // namespace stemvo
