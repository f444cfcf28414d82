// SPDX-License-Identifier: MIT
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "stemvo/benchmark/benchmark.hpp"
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
    request_.models_dir = STEMVO_SOURCE_DIR "/models";
    request_.num_threads = 1;
    Config config;
    config.stem.model = "gray";
    config.odometry.mode = "map";
    request_.configurations = {{"one", config}};
    config.seed = 2;
    request_.configurations.push_back({"two", config});
  }

  /// Names of the runs that were done anew, with why.
  BenchmarkReport run(std::size_t stop_at_run = 1000) {
    runs_.clear();
    const auto report = run_benchmark(request_, [&](const BenchmarkProgress& at) {
      if (at.frames_done == 0) {
        runs_.push_back(fmt::format("{} {} {}{}{}", at.sequence, at.configuration,
                                    to_string(at.protocol), at.note.empty() ? "" : ": ", at.note));
      }
      return at.run < stop_at_run || at.frames_done < 2;
    });
    EXPECT_TRUE(report) << report.error().message;
    return report.value_or(BenchmarkReport{});
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
  const BenchmarkReport report = run();
  EXPECT_THAT(runs_, ElementsAre("03 one camera_height", "03 one ground_truth",
                                 "03 two camera_height", "03 two ground_truth",
                                 "street one camera_height", "street one ground_truth",
                                 "street two camera_height", "street two ground_truth"));
  EXPECT_FALSE(has_failures(report));
  EXPECT_TRUE(fs::exists(request_.out_dir / "03.png"));
  EXPECT_TRUE(fs::exists(request_.out_dir / "runs/street/two_ground_truth/trajectory_kitti.txt"));
  const std::string first = written();
  EXPECT_THAT(first, AllOf(HasSubstr("clip 0:5 of 801"), HasSubstr("frames 0:5")));
  run();
  EXPECT_THAT(runs_, SizeIs(0));
  EXPECT_TRUE(written() == first);
}

TEST_F(BenchmarkRuns, OnlyWhatChangedIsRepeated) {
  run();
  request_.configurations[1].config.seed = 3;
  run();
  EXPECT_THAT(
      runs_,
      AllOf(SizeIs(4), Each(AllOf(HasSubstr(" two "), HasSubstr(": the configuration changed")))));
  std::ofstream(folder_ / "kitti/poses/street.txt", std::ios::app) << "\n";
  run();
  EXPECT_THAT(
      runs_,
      AllOf(SizeIs(4), Each(AllOf(HasSubstr("street "), HasSubstr(": the pose file changed")))));
  fs::remove(folder_ / "kitti/sequences/03/image_0/000004.png");
  run();
  EXPECT_THAT(runs_,
              AllOf(SizeIs(4), Each(AllOf(HasSubstr("03 "), HasSubstr(": the frames changed")))));
  std::ofstream(folder_ / "kitti/sequences/03/calib.txt", std::ios::app) << "\n";
  run();
  EXPECT_THAT(runs_, AllOf(SizeIs(4), Each(HasSubstr(": calib.txt or times.txt changed"))));
  run();
  EXPECT_THAT(runs_, SizeIs(0));
}

TEST_F(BenchmarkRuns, InterruptedAndResumedGivesTheSameReport) {
  run();
  const std::string whole = written();
  fs::remove_all(request_.out_dir);
  for (const std::size_t stop_at : {0U, 2U, 5U}) {
    const BenchmarkReport report = run(stop_at);
    EXPECT_TRUE(report.interrupted);
    EXPECT_THAT(written(), AllOf(HasSubstr("not run yet"), HasSubstr("\"interrupted\": true")));
  }
  // The run that was stopped starts anew; what was done before it is kept.
  EXPECT_THAT(runs_, ElementsAre("03 two camera_height", "03 two ground_truth",
                                 "street one camera_height", "street one ground_truth"));
  const BenchmarkReport report = run();
  EXPECT_FALSE(report.interrupted);
  EXPECT_THAT(runs_, SizeIs(3));
  EXPECT_TRUE(written() == whole);
}

TEST_F(BenchmarkRuns, OneSequenceThatFailsDoesNotStopTheOthers) {
  fs::remove(folder_ / "kitti/sequences/03/calib.txt");
  request_.sequences = {"03", "07", "street", "street"};
  const BenchmarkReport report = run();
  EXPECT_TRUE(has_failures(report));
  EXPECT_THAT(report.sequences, SizeIs(3));
  EXPECT_THAT(report.sequences[0].problem, HasSubstr("calib.txt"));
  EXPECT_THAT(report.sequences[1].problem, HasSubstr("07: expected a sequence folder"));
  EXPECT_THAT(runs_, AllOf(SizeIs(4), Each(HasSubstr("street "))));
  EXPECT_THAT(written(), AllOf(HasSubstr("calib.txt"), HasSubstr("frames 0:5")));
}

TEST_F(BenchmarkRuns, WithoutGroundTruthTheErrorsAreDashes) {
  fs::remove(folder_ / "kitti/poses/street.txt");
  request_.sequences = {"street"};
  const BenchmarkReport report = run();
  EXPECT_FALSE(has_failures(report));
  EXPECT_THAT(runs_, ElementsAre("street one camera_height", "street two camera_height"));
  EXPECT_EQ(report.sequences[0].runs[1].state, BenchmarkState::kNotPossible);
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
  EXPECT_THAT(message(), HasSubstr("expected a folder of sequences"));
  fs::create_directories(folder_ / "nothing/sequences");
  EXPECT_THAT(message(), HasSubstr("expected a folder per sequence, found none"));
  request_.kitti_root = folder_ / "kitti";
  request_.out_dir = folder_.file("taken", "a file");
  EXPECT_THAT(message(), HasSubstr("expected an output folder"));
}

}  // namespace
}  // namespace stemvo
