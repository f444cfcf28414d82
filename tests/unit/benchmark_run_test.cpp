// SPDX-License-Identifier: MIT
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "benchmark/benchmark.hpp"
#include "support/temp_folder.hpp"

namespace stemvo {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::read_all;
using ::testing::SizeIs;

constexpr int kNumFrames = 5;

/// The sequence 03 of below is all there is of an official one.
constexpr char kPublished[] = R"({
  "sequences": {"03": {"frames": 5, "length_m": 2, "width_px": 160, "height_px": 80}},
  "published": [
    {"method": "a method", "scale_source": "stereo", "alignment": "none",
     "t_rel_percent": {"03": 11.43, "04": 12.5}, "r_rel_deg_per_100m": {"03": 0.58},
     "average_offset_m": {}, "ate_rmse_m": {}, "source": "a journal"},
    {"method": "another one", "scale_source": "stereo", "alignment": "none",
     "t_rel_percent": {}, "r_rel_deg_per_100m": {}, "average_offset_m": {},
     "ate_rmse_m": {"04": 3.5}, "source": "a journal"}]})";

/// A few frames of a wall of noise that comes nearer.
void write_sequence(const fs::path& root, const std::string& name) {
  const fs::path sequence = root / "sequences" / name;
  fs::create_directories(sequence / "image_0");
  fs::create_directories(root / "poses");
  std::ofstream(sequence / "calib.txt") << "P0: 100 0 79.5 0 0 100 39.5 0 0 0 1 0\n";
  std::ofstream times(sequence / "times.txt");
  std::ofstream poses(root / "poses" / (name + ".txt"));
  cv::Mat wall(80, 160, CV_8UC1);
  cv::theRNG().state = 1;
  cv::randu(wall, 0, 256);
  cv::GaussianBlur(wall, wall, {}, 1.5);
  for (int i = 0; i < kNumFrames; ++i) {
    times << 0.1 * i << "\n";
    poses << fmt::format("1 0 0 0 0 1 0 0 0 0 1 {}\n", 0.5 * i);
    const double scale = 12.0 / (12.0 - 0.5 * i);
    const cv::Matx23d map(scale, 0, 79.5 * (1 - scale), 0, scale, 39.5 * (1 - scale));
    cv::Mat view;
    cv::warpAffine(wall, view, map, wall.size());
    cv::imwrite((sequence / fmt::format("image_0/{:06}.png", i)).string(), view);
  }
}

class BenchmarkRuns : public ::testing::Test {
 protected:
  void SetUp() override {
    write_sequence(folder_ / "kitti", "03");
    write_sequence(folder_ / "kitti", "street");
    request_.kitti_root = folder_ / "kitti";
    request_.out_dir = folder_ / "out";
    request_.published = folder_.file("published.json", kPublished);
    request_.num_threads = 1;
    Config config;
    config.stem.model = "gray";
    config.odometry.mode = OdometryMode::kMap;
    request_.configurations = {{"one", config}};
    config.seed = 2;
    request_.configurations.push_back({"two", config});
  }

  /// Keeps the titles of the runs that were done anew, with why.
  BenchmarkSummary run(std::size_t stop_at_run = 1000) {
    runs_.clear();
    bool stop = false;
    request_.on_run = [&](const std::string& run) {
      runs_.push_back(run);
      return !stop;
    };
    request_.on_frame = [&](std::size_t done, std::size_t) {
      stop = stop || (runs_.back()[0] - '1' >= static_cast<int>(stop_at_run) && done >= 2);
      return !stop;
    };
    const auto summary = run_benchmark(request_);
    EXPECT_TRUE(summary) << summary.error().message;
    return summary.value_or(BenchmarkSummary{});
  }
  [[nodiscard]] nlohmann::json report() const {
    return nlohmann::json::parse(read_all(request_.out_dir / "benchmark.json"));
  }
  [[nodiscard]] std::string written() const {
    return read_all(request_.out_dir / "benchmark.md") +
           read_all(request_.out_dir / "benchmark.json");
  }

  testing::TempFolder folder_;
  BenchmarkRequest request_;
  std::vector<std::string> runs_;
};

TEST_F(BenchmarkRuns, RunsEachSequenceUnderEachConfigurationAndProtocolOnce) {
  const BenchmarkSummary summary = run();
  EXPECT_THAT(runs_,
              ElementsAre("1/8 03, one, camera_height", "2/8 03, one, ground_truth",
                          "3/8 03, two, camera_height", "4/8 03, two, ground_truth",
                          "5/8 street, one, camera_height", "6/8 street, one, ground_truth",
                          "7/8 street, two, camera_height", "8/8 street, two, ground_truth"));
  EXPECT_THAT(summary.failures, SizeIs(0));
  EXPECT_TRUE(fs::exists(request_.out_dir / "report.html"));
  EXPECT_TRUE(fs::exists(request_.out_dir / "runs/street/two_ground_truth/trajectory_kitti.txt"));
  const std::string first = written();
  EXPECT_THAT(first, AllOf(HasSubstr("all 5 frames"), HasSubstr("frames 0:5")));
  EXPECT_EQ(report()["sequences"][0]["zero_motion"]["average_offset_m"], 1.0);
  // No times where reports are compared.
  EXPECT_THAT(first, Not(HasSubstr("fps")));
  EXPECT_EQ(nlohmann::json::parse(read_all(request_.out_dir / "speed.json")).size(), 8U);
  run();
  EXPECT_THAT(runs_, SizeIs(0));
  EXPECT_TRUE(written() == first);
}

TEST_F(BenchmarkRuns, OnlyWhatChangedIsRepeated) {
  run();
  request_.configurations[1].second.seed = 3;
  run();
  EXPECT_THAT(runs_, AllOf(SizeIs(4), Each(AllOf(HasSubstr(" two, "),
                                                 HasSubstr("(again: configuration changed)")))));
  std::ofstream(folder_ / "kitti/poses/street.txt", std::ios::app) << "\n";
  run();
  EXPECT_THAT(runs_, AllOf(SizeIs(4), Each(AllOf(HasSubstr("street, "),
                                                 HasSubstr("(again: ground_truth changed)")))));
  fs::remove(folder_ / "kitti/sequences/03/image_0/000004.png");
  std::ofstream(folder_ / "kitti/sequences/03/calib.txt", std::ios::app) << "\n";
  run();
  EXPECT_THAT(runs_,
              AllOf(SizeIs(4), Each(AllOf(HasSubstr("03, "),
                                          HasSubstr("(again: frames, calibration changed)")))));
  std::ofstream(request_.out_dir / "runs/03/one_camera_height/benchmark_inputs.json") << "{\"fra";
  fs::remove(request_.out_dir / "runs/03/two_camera_height/metrics.json");
  run();
  EXPECT_THAT(runs_, ElementsAre(HasSubstr("benchmark_inputs.json: not JSON"),
                                 HasSubstr("(again: metrics.json changed)")));
  const fs::path poses = request_.out_dir / "runs/street/one_camera_height/trajectory_kitti.txt";
  fs::resize_file(poses, fs::file_size(poses) - 10);
  std::ofstream(request_.out_dir / "runs/street/two_camera_height/trajectory_kitti.txt")
      << "1 0 0 0 0 1 0 0 0 0 1 0\n";
  run();
  EXPECT_THAT(runs_, ElementsAre(HasSubstr("(again: trajectory_kitti.txt changed)"),
                                 HasSubstr("(again: trajectory_kitti.txt changed)")));
  run();
  EXPECT_THAT(runs_, SizeIs(0));
}

/// Published numbers stand beside 03, whose frames, size and length are those of an official
/// sequence.
TEST_F(BenchmarkRuns, PublishedNumbersStandOnlyBesideAllOfficialFrames) {
  request_.sequences = {"03"};
  request_.configurations.resize(1);
  run();
  EXPECT_THAT(written(), AllOf(HasSubstr("| a method | stereo | none | 11.43 | 0.58 | - | - | "
                                         "published: a journal |\n"),
                               Not(HasSubstr("another one")), Not(HasSubstr("clip"))));
  const nlohmann::json rows = report()["sequences"][0]["published"];
  ASSERT_EQ(rows.size(), 1U);
  EXPECT_EQ(rows[0]["t_rel_percent"], 11.43);
  EXPECT_TRUE(rows[0]["average_offset_m"].is_null());
  for (const char* change :
       {"\"frames\": 6", "\"length_m\": 4", "\"width_px\": 161", "\"height_px\": 81"}) {
    std::string published = kPublished;
    const std::string key = std::string(change).substr(0, std::string(change).find(' '));
    const std::size_t at = published.find(key);
    published.replace(at, published.find_first_of(",}", at) - at, change);
    request_.published = folder_.file("published.json", published);
    run();
    EXPECT_THAT(written(), AllOf(HasSubstr("clip 0:5 of "), Not(HasSubstr("11.43")))) << change;
  }
  request_.published = folder_.file("published.json", kPublished);
  fs::remove(folder_ / "kitti/poses/03.txt");
  run();
  EXPECT_THAT(written(), AllOf(HasSubstr("clip 0:5 of 5"), Not(HasSubstr("11.43"))));
}

TEST_F(BenchmarkRuns, InterruptedAndResumedGivesTheSameReport) {
  run();
  const std::string whole = written();
  fs::remove_all(request_.out_dir);
  for (const std::size_t stop_at : {0U, 2U, 5U}) {
    EXPECT_TRUE(run(stop_at).interrupted);
    EXPECT_THAT(written(), AllOf(HasSubstr("not run yet"), HasSubstr("\"interrupted\": true")));
  }
  // The run that was stopped starts anew; what was done before it is kept.
  EXPECT_THAT(runs_,
              ElementsAre("3/8 03, two, camera_height", "4/8 03, two, ground_truth",
                          "5/8 street, one, camera_height", "6/8 street, one, ground_truth"));
  EXPECT_FALSE(run().interrupted);
  EXPECT_THAT(runs_, SizeIs(3));
  EXPECT_TRUE(written() == whole);
}

TEST_F(BenchmarkRuns, OneSequenceThatFailsDoesNotStopTheOthers) {
  fs::remove(folder_ / "kitti/sequences/03/calib.txt");
  request_.sequences = {"03", "07", "street", "street"};
  const BenchmarkSummary summary = run();
  EXPECT_THAT(summary.failures,
              ElementsAre(AllOf(HasSubstr("03: "), HasSubstr("calib.txt")),
                          AllOf(HasSubstr("07: "), HasSubstr("expected a sequence folder"))));
  EXPECT_EQ(report()["sequences"].size(), 3U);
  EXPECT_THAT(runs_, AllOf(SizeIs(4), Each(HasSubstr("street, "))));
  EXPECT_THAT(written(), AllOf(HasSubstr("calib.txt"), HasSubstr("frames 0:5")));
}

TEST_F(BenchmarkRuns, WithoutGroundTruthTheErrorsAreDashes) {
  fs::remove(folder_ / "kitti/poses/street.txt");
  request_.sequences = {"street"};
  EXPECT_THAT(run().failures, SizeIs(0));
  EXPECT_THAT(runs_,
              ElementsAre("1/4 street, one, camera_height", "3/4 street, two, camera_height"));
  EXPECT_EQ(report()["sequences"][0]["runs"][1]["state"], "not possible");
  EXPECT_THAT(written(), AllOf(HasSubstr("| one, camera height | - |"),
                               HasSubstr("no ground truth"), Not(HasSubstr("nan"))));
}

TEST_F(BenchmarkRuns, WrongRequestsAreErrors) {
  const auto message = [&] {
    const auto report = run_benchmark(request_);
    return report ? std::string("no error") : report.error().message;
  };
  request_.sequences = {"../03"};
  EXPECT_THAT(message(), HasSubstr("expected the names of folders in it, found '../03'"));
  request_.sequences.clear();
  request_.kitti_root = folder_ / "nothing";
  EXPECT_THAT(message(), HasSubstr("expected a folder per sequence, found: No such file"));
  fs::create_directories(folder_ / "nothing/sequences");
  EXPECT_THAT(message(), HasSubstr("expected a folder per sequence, found: none"));
  request_.kitti_root = folder_ / "kitti";
  request_.published = folder_.file("broken.json", "{\"sequences\": {}}");
  EXPECT_THAT(message(), AllOf(HasSubstr("broken.json: expected official sequences"),
                               HasSubstr("'published'")));
  request_.published = folder_ / "none.json";
  EXPECT_THAT(message(), HasSubstr("none.json: cannot read"));
  request_.published = folder_.file("published.json", kPublished);
  request_.out_dir = folder_.file("taken", "a file");
  EXPECT_THAT(message(), HasSubstr("expected an output folder"));
}

}  // namespace
}  // namespace stemvo
