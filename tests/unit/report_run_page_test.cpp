// SPDX-License-Identifier: MIT
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "evaluation/pose_file.hpp"
#include "report/run_page.hpp"
#include "support/temp_folder.hpp"
#include "text/text_file.hpp"

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
      FrameResult frame;
      frame.state = i == 0 ? FrameState::kFirst : FrameState::kTracking;
      frame.num_matches = 400 + i;
      frame.num_inliers = 300;
      frame.camera = {700.0, 700.0, 600.0 + 0.01 * i, 180.0, 1241, 376};
      frames_.push_back(frame);
      numbers_.push_back(100U + 2U * static_cast<std::size_t>(i));
    }
    report_.num_frames = frames_.size();
    report_.metrics = evaluate(estimate_, truth_->poses);
  }

  json content() {
    EXPECT_TRUE(write_run_page(folder_ / "report.html", {"a drive",
                                                         "",
                                                         "m",
                                                         report_,
                                                         frames_,
                                                         numbers_,
                                                         estimate_,
                                                         truth_,
                                                         {},
                                                         "key: value",
                                                         "stemvo run"}));
    const std::string text = read_text_file(folder_ / "report.html").value_or("");
    const std::string begin = "id=\"content\">";
    const std::size_t at = text.find(begin) + begin.size();
    return json::parse(text.substr(at, text.find("</script>", at) - at));
  }
  static json section(const json& page, const std::string& heading) {
    for (const json& found : page["sections"]) {
      if (found["heading"] == heading) {
        return found;
      }
    }
    return {};
  }

  testing::TempFolder folder_;
  Trajectory estimate_;
  std::optional<GroundTruth> truth_;
  std::vector<FrameResult> frames_;
  std::vector<std::size_t> numbers_;
  MetricsReport report_;
};

TEST_F(RunPageTest, ShowsPathsErrorsAndFrames) {
  const json page = content();
  ASSERT_EQ(page["frames"].size(), 201U);
  EXPECT_EQ(page["frames"][200],
            "frame 500: tracking, 300 of 600 tracks are inliers, 2.01 m off after 200.0 m");

  const json top = section(page, "Path from above");
  EXPECT_EQ(top["traces"][top["frame_trace"].get<int>()]["name"], "estimate");
  EXPECT_EQ(top["traces"][1]["y"][100], 101.0);
  EXPECT_EQ(top["traces"][0]["y"][100], 100.0);

  const json error = section(page, "Error over distance");
  EXPECT_EQ(error["traces"][0]["x"][200], 200.0);
  EXPECT_NEAR(error["traces"][0]["y"][200].get<double>(), std::hypot(2.0, 0.2), 1e-4);
  EXPECT_EQ(error["traces"][1]["y"][200], 0.2) << "too high";

  // 1 % and a little of the climb, whatever the length; 100 m is the only length that fits in
  // twice.
  const json lengths = section(page, "Error by segment length");
  const json mean = lengths["traces"][1];
  EXPECT_EQ(mean["name"], "t_rel, mean");
  EXPECT_EQ(mean["x"][0], 100.0);
  EXPECT_NEAR(mean["y"][0].get<double>(), 100.0 * std::hypot(0.01, 0.001), 0.03);

  const json tracks = section(page, "Tracks, model and state");
  EXPECT_EQ(tracks["traces"][0]["x"][1], 102) << "in the folder's numbering";
  EXPECT_EQ(tracks["traces"][0]["y"][200], 600);
  EXPECT_EQ(tracks["traces"][3]["y"][1], "tracking");

  const auto hover = [&](const char* heading, const char* axis) {
    return section(page, heading)["layout"][axis]["hoverformat"];
  };
  EXPECT_EQ(hover("Time per stage", "yaxis"), ".1f");
  EXPECT_EQ(hover("Scale and camera", "yaxis"), ".2f") << "pixels";
  EXPECT_EQ(hover("Error over distance", "yaxis"), ".3f");
}

TEST_F(RunPageTest, FiguresOverFramesShowTheSameFrames) {
  const json page = content();
  const auto axis = [&](const char* heading, const char* name) {
    return section(page, heading)["layout"][name];
  };
  const json range = axis("Time per stage", "xaxis")["range"];
  EXPECT_LT(range[0], 100);
  EXPECT_GT(range[1], 500);
  EXPECT_EQ(axis("Tracks, model and state", "xaxis")["range"], range);
  EXPECT_EQ(axis("Scale and camera", "xaxis")["range"], range);
}

TEST_F(RunPageTest, SmallAndLargeValuesAreSeen) {
  frames_[1].homography_ratio = 0.97;  // the only one that is scored
  frames_[1].homography_score = 97.0;
  frames_[1].fundamental_score = 3.0;
  frames_[1].scale_sigma = 1.0;
  const json page = content();
  EXPECT_GT(section(page, "Tracks, model and state")["layout"]["yaxis2"]["range"][1], 1.0);
  EXPECT_EQ(section(page, "Scale and camera")["layout"]["yaxis3"]["type"], "log");
}

// 0.2 m up on 202 m: true to scale, nothing of it would be seen.
TEST_F(RunPageTest, EachAxisOfTheSpaceIsLongEnoughForItsTicks) {
  const json scene = section(content(), "Path in space")["layout"]["scene"];
  EXPECT_EQ(scene["aspectratio"]["y"], 1.0);
  EXPECT_GT(scene["aspectratio"]["z"], 0.4);
  EXPECT_LT(scene["zaxis"]["range"][0], 0.0);
  EXPECT_GT(scene["zaxis"]["range"][1], 0.2);
  EXPECT_LT(scene["zaxis"]["range"][1], 0.3);
}

TEST_F(RunPageTest, FramesWithoutATruePoseAreShownWithoutTheirErrors) {
  truth_->frames = {40, 100, 190};
  truth_->poses = take_poses(truth_->poses, truth_->frames);
  report_.metrics = evaluate(take_poses(estimate_, truth_->frames), truth_->poses);
  const json page = content();
  ASSERT_EQ(page["frames"].size(), 201U);
  EXPECT_EQ(page["frames"][99], "frame 298: tracking, 300 of 499 tracks are inliers");
  EXPECT_EQ(page["frames"][100],
            "frame 300: tracking, 300 of 500 tracks are inliers, 1.00 m off after 60.0 m");

  const json top = section(page, "Path from above");
  EXPECT_EQ(top["traces"][0]["y"], json::array({40.0, 100.0, 190.0}));
  EXPECT_EQ(top["traces"][1]["y"].size(), 201U);
  const json error = section(page, "Error over distance")["traces"][0];
  ASSERT_EQ(error["y"].size(), 201U) << "as the slider counts";
  EXPECT_TRUE(error["x"][99].is_null() && error["y"][99].is_null());
  EXPECT_EQ(error["x"][190], 150.0);
  EXPECT_NEAR(error["y"][190].get<double>(), std::hypot(1.9, 0.19), 1e-4);
  EXPECT_EQ(error["connectgaps"], true);
  EXPECT_EQ(section(page, "Error by segment length")["traces"][0]["x"], json::array({100.0}));
  EXPECT_EQ(section(page, "Scale and camera")["traces"][0]["y"][100], 1.01) << "a frame's step";
}

TEST_F(RunPageTest, ShowsScaleAndCameraWithTheirSigma) {
  json traces = section(content(), "Scale and camera")["traces"];
  ASSERT_EQ(traces.size(), 3U) << "no sigma, so no lines for it";
  EXPECT_NEAR(traces[1]["y"][200].get<double>(), 2.0, 1e-4);

  for (FrameResult& frame : frames_) {
    frame.scale_sigma = 0.02;
    frame.camera_sigma = {3.0, 0.5, 0.25};
  }
  traces = section(content(), "Scale and camera")["traces"];
  ASSERT_EQ(traces.size(), 8U);
  EXPECT_NEAR(traces[1]["y"][200].get<double>(), 1.5, 1e-4);
  EXPECT_NEAR(traces[2]["y"][200].get<double>(), 2.5, 1e-4);
  EXPECT_EQ(traces[2]["fill"], "tonexty");
  EXPECT_NEAR(traces[5]["y"][200].get<double>(), 0.25, 1e-4);
  EXPECT_EQ(traces[7]["y"][200], 2.0) << "percent";

  frames_.back().camera.fx_px += 4.0;
  traces = section(content(), "Scale and camera")["traces"];
  ASSERT_EQ(traces.size(), 11U) << "the focal length where it left the given one";
  EXPECT_NEAR(traces[7]["y"][200].get<double>(), 4.0 - 3.0, 1e-4);
  EXPECT_NEAR(traces[9]["y"][200].get<double>(), 4.0, 1e-4);
}

TEST_F(RunPageTest, WithoutGroundTruthNoErrorsAreShown) {
  truth_.reset();
  report_.metrics.reset();
  const json page = content();
  EXPECT_TRUE(section(page, "Error over distance").is_null());
  EXPECT_TRUE(section(page, "Error by segment length").is_null());
  EXPECT_EQ(section(page, "Path from above")["traces"].size(), 1U);
  EXPECT_EQ(page["frames"][0], "frame 100: first, 300 of 400 tracks are inliers");
}

TEST_F(RunPageTest, WhatIsNotFiniteIsLeftOut) {
  estimate_[7].translation.x() = std::numeric_limits<double>::quiet_NaN();
  truth_.reset();
  report_.metrics.reset();
  EXPECT_TRUE(section(content(), "Path from above")["traces"][0]["x"][7].is_null());
}

}  // namespace
}  // namespace stemvo
