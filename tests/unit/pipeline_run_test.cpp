// SPDX-License-Identifier: MIT
#include <nlohmann/json.hpp>

#include "evaluation/trajectory.hpp"
#include "pipeline/run.hpp"
#include "report/data_files.hpp"
#include "support/ply_reader.hpp"
#include "support/report_content.hpp"
#include "support/state_runs.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

/// A wall of blurred noise that the camera drives towards: a few small gray frames in KITTI's
/// layout, as input of the gray channel.
class PipelineRun : public ::testing::Test {
 protected:
  static constexpr int kNumFrames = 6;
  static constexpr double kStep_m = 0.5;

  void SetUp() override {
    const fs::path sequence = folder_ / "sequences/07";
    fs::create_directories(sequence / "image_0");
    fs::create_directories(folder_ / "poses");
    std::ofstream(sequence / "calib.txt") << "P0: 200 0 159.5 0 0 200 79.5 0 0 0 1 0\n";
    std::ofstream times(sequence / "times.txt");
    std::ofstream poses(folder_ / "poses/07.txt");
    cv::Mat wall(480, 960, CV_8UC1);
    cv::theRNG().state = 1;
    cv::randu(wall, 0, 256);
    cv::GaussianBlur(wall, wall, {}, 2.0);
    cv::normalize(wall, wall, 0, 255, cv::NORM_MINMAX);
    for (int i = 0; i < kNumFrames; ++i) {
      times << 0.1 * i << "\n";
      poses << fmt::format("1 0 0 0 0 1 0 0 0 0 1 {}\n", kStep_m * i);
      // The left half of the wall stands at 12 m, the right half at 20 m: no plane, so that E
      // exists.
      cv::Mat frame(160, 320, CV_8UC1);
      for (int half = 0; half < 2; ++half) {
        const double scale =
            (half == 0 ? 12.0 : 20.0) / 10.0 / ((half == 0 ? 12.0 : 20.0) - kStep_m * i) * 10.0;
        const cv::Matx23d map(scale, 0, 159.5 - 479.5 * scale, 0, scale, 79.5 - 239.5 * scale);
        cv::Mat view;
        cv::warpAffine(wall, view, map, frame.size(), cv::INTER_LINEAR);
        const cv::Rect side(half == 0 ? 0 : 160, 0, 160, 160);
        view(side).copyTo(frame(side));
      }
      cv::imwrite((sequence / fmt::format("image_0/{:06}.png", i)).string(), frame);
    }
    request_.sequence_dir = sequence;
    request_.out_dir = folder_ / "out";
    request_.config.stem.model = "gray";
    request_.num_threads = 1;
  }

  [[nodiscard]] std::string error_of(const RunRequest& request) const {
    return message_of(run_sequence(request));
  }

  TempFolder folder_;
  RunRequest request_;
};

TEST_F(PipelineRun, WritesAPosePerFrameOfUnitLengthSteps) {
  request_.config.scale_choice = ScaleChoice::kOptions;
  request_.image_every = 4;
  const Expected<RunSummary> summary = run_sequence(request_);
  EXPECT_EQ(summary->report.num_frames, 6U);
  EXPECT_EQ(summary->report.sequence, "07");
  ASSERT_TRUE(summary->report.metrics.has_value());
  const std::string csv = read_all(request_.out_dir / "frames.csv");
  const auto errors = column(csv, "error_m");
  double sum = 0.0;
  for (const std::string& error : errors) {
    sum += std::pow(std::stod(error), 2) / static_cast<double>(errors.size());
  }
  EXPECT_NEAR(std::sqrt(sum), summary->report.metrics->ate_rmse.sim3_m, 1e-4);
  EXPECT_FALSE(summary->interrupted);
  EXPECT_TRUE(summary->warnings.empty());
  const auto poses = read_kitti_trajectory(request_.out_dir / "trajectory_kitti.txt");
  EXPECT_EQ(poses->size(), 6U);
  for (const char* name :
       {"trajectory_tum.txt", "trajectory_map_tum.txt", "map.ply", "frames.csv", "config.yaml",
        "metrics.json", "trajectory.png", "pictures/000000.png", "pictures/000004.png"}) {
    EXPECT_TRUE(fs::exists(request_.out_dir / name)) << name;
  }
}

TEST_F(PipelineRun, GroundTruthScaleRescalesStepsAndNothingElse) {
  request_.config.odometry.mode = OdometryMode::kTwoFrame;
  request_.config.scale_choice = ScaleChoice::kOptions;
  ASSERT_TRUE(run_sequence(request_).value().written);
  const auto constant = read_kitti_trajectory(request_.out_dir / "trajectory_kitti.txt");
  request_.config.scale_choice = ScaleChoice::kGroundTruth;
  ASSERT_TRUE(run_sequence(request_).value().written);
  const auto rescaled = read_kitti_trajectory(request_.out_dir / "trajectory_kitti.txt");
  ASSERT_TRUE(constant && rescaled);
  for (std::size_t i = 0; i < constant->size(); ++i) {
    EXPECT_LT((*constant)[i].rotation.angularDistance((*rescaled)[i].rotation), 1e-9);
    if (i > 0) {
      const double step = ((*rescaled)[i].translation - (*rescaled)[i - 1].translation).norm();
      const double before = ((*constant)[i].translation - (*constant)[i - 1].translation).norm();
      EXPECT_TRUE(before == 0.0 || std::abs(before - 1.0) < 1e-6) << i << ": " << before;
      EXPECT_TRUE(before == 0.0 || std::abs(step - kStep_m) < 1e-6) << i << ": " << step;
    }
  }
}

TEST_F(PipelineRun, TimingIsThereWhereItIsAskedForAndChangesNothingElse) {
  const auto plain = run_sequence(request_);
  EXPECT_FALSE(plain->report.timing.has_value());
  const std::string poses = read_all(request_.out_dir / "trajectory_kitti.txt");
  auto keys = nlohmann::ordered_json::parse(read_all(request_.out_dir / "metrics.json"));
  EXPECT_FALSE(keys.contains("timing"));

  request_.measure_times = true;
  const auto measured = run_sequence(request_);
  EXPECT_EQ(read_all(request_.out_dir / "trajectory_kitti.txt"), poses);
  auto json = nlohmann::ordered_json::parse(read_all(request_.out_dir / "metrics.json"));
  const auto timing = json["timing"];
  for (const char* name : {"read and decode", "stem", "contrast", "pyramid"}) {
    EXPECT_EQ(timing["stages"][name]["calls"], 6) << name;
  }
  for (const char* name : {"detection", "tracking", "homography", "epipolar geometry"}) {
    EXPECT_GE(timing["stages"][name]["calls"], 1) << name;
  }
  EXPECT_FALSE(timing["stages"].contains("description")) << "klt describes nothing";
  EXPECT_EQ(timing["stages"]["result files"]["calls"], 1);
  EXPECT_EQ(timing["threads"], 1);
  EXPECT_EQ(measured->report.timing->num_frames, 6U);
  EXPECT_GT(timing["peak_memory_mib"].get<double>(), 1.0);
  json.erase("timing");
  for (auto* one : {&json, &keys}) {  // those of the others that depend on the clock
    (*one)["fps"] = (*one)["map"]["adjustment_s"] = 0;
  }
  EXPECT_EQ(json.dump(), keys.dump());
}

TEST_F(PipelineRun, WithoutAScaleTheErrorIsTakenAfterAFit) {
  request_.config.odometry.mode = OdometryMode::kTwoFrame;
  request_.config.scale_choice = ScaleChoice::kOptions;
  request_.config.scale.step_m = 0.25;
  const auto summary = run_sequence(request_);
  const auto poses = read_kitti_trajectory(request_.out_dir / "trajectory_kitti.txt").value();
  for (std::size_t i = 1; i < poses.size(); ++i) {
    EXPECT_NEAR((poses[i].translation - poses[i - 1].translation).norm(), 1.0, 1e-6) << i;
  }
  const Metrics& metrics = summary->report.metrics.value();
  EXPECT_EQ(metrics.alignment, Alignment::kSim3);
  EXPECT_LE(metrics.average_offset_m, 0.2 * metrics.null_offset_m);
  EXPECT_GE(metrics.ate_rmse.none_m, metrics.null_offset_m * 0.5) << "two times too long";
  EXPECT_THAT(read_all(request_.out_dir / "metrics.json"), HasSubstr("\"alignment\": \"sim3\""));
  EXPECT_THAT(read_all(request_.out_dir / "trajectory.png"), HasSubstr("PNG"));
}

TEST_F(PipelineRun, ThePageHoldsFramesThatLackATruePose) {
  const fs::path truth = folder_ / "truth.txt";
  std::ofstream(truth) << "0.1 0 0 0.05 0 0 0 1\n0.4 0 0 0.2 0 0 0 1\n";
  request_.ground_truth = truth;
  request_.config.scale_choice = ScaleChoice::kOptions;
  const auto summary = run_sequence(request_);
  ASSERT_TRUE(summary) << summary.error().message;
  const nlohmann::json page = report_content(read_all(request_.out_dir / "report.html"));
  EXPECT_EQ(page["frames_csv"], read_all(request_.out_dir / "frames.csv"));
  EXPECT_EQ(page["estimate"]["x"].size(), 1U * kNumFrames);
  EXPECT_EQ(page["truth"]["x"].size(), 2U);
  EXPECT_EQ(page["truth"]["frames"], nlohmann::json({1, 4}));
  EXPECT_THAT(page["subtitle"].get<std::string>(),
              AllOf(HasSubstr("path 0.15 m, fitted by sim3: average offset "),
                    HasSubstr(", ground truth for 2 of 6 frames")));
}

TEST_F(PipelineRun, TheMapHoldsTheWallAndThePathInMetres) {
  request_.config.odometry.mode = OdometryMode::kMap;
  request_.config.scale_choice = ScaleChoice::kGroundTruth;
  const auto summary = run_sequence(request_);
  ASSERT_TRUE(summary) << summary.error().message;
  const auto poses = read_kitti_trajectory(request_.out_dir / "trajectory_map_kitti.txt");
  const PlyFile map = read_ply(request_.out_dir / "map.ply");
  ASSERT_EQ(map.edges.size() + 1, poses->size());
  ASSERT_GT(map.vertices.size(), 100U + poses->size());
  const std::size_t num_points = map.vertices.size() - poses->size();
  for (std::size_t i = 0; i < poses->size(); ++i) {
    EXPECT_LT(
        (map.vertices[num_points + i].position - (*poses)[i].translation.cast<float>()).norm(),
        0.01F);
    EXPECT_EQ(map.vertices[num_points + i].rgb, kMapPathColor);
  }
  // The wall's left half stands at 12 m, its right half at 20 m.
  std::size_t num_good = 0;
  for (std::size_t i = 0; i < num_points; ++i) {
    const PlyFile::Vertex& point = map.vertices[i];
    const float depth_m = point.position.x() < 0.0F ? 12.0F : 20.0F;
    num_good += std::abs(point.position.z() - depth_m) < 0.05F * depth_m ? 1 : 0;
    EXPECT_EQ(point.rgb[0], point.rgb[1]) << "a gray camera";
  }
  EXPECT_GE(num_good, num_points * 8 / 10) << num_good << " of " << num_points;
}

TEST_F(PipelineRun, AFileWhoseTimesMissAllFramesIsAWarning) {
  const auto warnings_with = [&](const std::string& rows) {
    request_.gyro = folder_ / "gyro.csv";
    std::ofstream(*request_.gyro) << rows;
    return run_sequence(request_).value().warnings;
  };
  EXPECT_THAT(warnings_with("100 0 0 0\n101 0 0 0\n"),
              Contains(HasSubstr("--gyro: expected times among those of the frames, 0 to 0.5 s, "
                                 "found 100 to 101 s")));
  EXPECT_THAT(warnings_with("-1 0 0 0\n0.2 0 0 0\n"), Not(Contains(HasSubstr("--gyro"))));
}

TEST_F(PipelineRun, ReplacesItsOwnFilesAndNoOthers) {
  request_.config.odometry.mode = OdometryMode::kTwoFrame;  // no map
  request_.config.scale.source = ScaleSource::kConstantSpeed;
  request_.image_every = 1;
  ASSERT_TRUE(run_sequence(request_));
  EXPECT_TRUE(fs::exists(request_.out_dir / "pictures/000001.png"));
  std::ofstream(request_.out_dir / "map.ply") << "of an earlier run";
  std::ofstream(request_.out_dir / "notes.txt") << "somebody's";
  request_.image_every = 0;
  ASSERT_TRUE(run_sequence(request_));
  EXPECT_FALSE(fs::exists(request_.out_dir / "map.ply"));
  EXPECT_FALSE(fs::exists(request_.out_dir / "pictures"));
  EXPECT_TRUE(fs::exists(request_.out_dir / "notes.txt"));
}

TEST_F(PipelineRun, TwoFramesMakeNoMap) {
  request_.config.odometry.mode = OdometryMode::kTwoFrame;
  request_.config.scale.source = ScaleSource::kConstantSpeed;
  ASSERT_TRUE(run_sequence(request_));
  for (const char* name : {"map.ply", "trajectory_map_kitti.txt", "trajectory_map_tum.txt"}) {
    EXPECT_FALSE(fs::exists(request_.out_dir / name)) << name;
  }
  EXPECT_TRUE(nlohmann::json::parse(read_all(request_.out_dir / "metrics.json"))["map"].is_null());
  request_.saved_map = folder_ / "saved.map";
  EXPECT_THAT(error_of(request_), HasSubstr("--save-map: expected odometry.mode map with"));
  request_.saved_map.reset();
  request_.map = folder_ / "saved.map";
  EXPECT_THAT(error_of(request_), HasSubstr("saved.map: expected odometry.mode map with"));
}

TEST_F(PipelineRun, WithoutLoopsNothingIsRemembered) {
  request_.config.odometry.loops = false;
  ASSERT_TRUE(run_sequence(request_));
  EXPECT_TRUE(fs::exists(request_.out_dir / "map.ply"));
  EXPECT_FALSE(fs::exists(request_.out_dir / "trajectory_map_kitti.txt"));
  request_.saved_map = folder_ / "saved.map";
  EXPECT_THAT(error_of(request_), HasSubstr("found loops false"));
}

TEST_F(PipelineRun, AMapIsSavedAndTakenUpAgain) {
  request_.saved_map = folder_ / "saved.map";
  const auto first = run_sequence(request_);
  ASSERT_TRUE(first && first->written);
  EXPECT_GE(first->report.map->num_keyframes, 2U);
  EXPECT_TRUE(first->report.map->metrics.has_value());
  EXPECT_EQ(read_kitti_trajectory(request_.out_dir / "trajectory_map_kitti.txt")->size(),
            std::size_t{kNumFrames});
  request_.map = request_.saved_map;
  const auto second = run_sequence(request_);
  EXPECT_GT(second->report.map->num_keyframes, first->report.map->num_keyframes);
  request_.config.stem.model = "log";
  EXPECT_THAT(error_of(request_), HasSubstr("saved.map: expected a map of channel 'log"));
  request_.map.reset();
  request_.saved_map = folder_.file("poses.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n");
  EXPECT_THAT(error_of(request_), HasSubstr("poses.txt: expected a new file or a map of stemvo"));
  request_.saved_map = folder_ / "nowhere/saved.map";
  EXPECT_THAT(error_of(request_), HasSubstr("nowhere/saved.map: cannot write"));
}

TEST_F(PipelineRun, StoppedEarlyHoldsWhatWasComputed) {
  request_.frames = FrameRangeRequest{1, 6};
  const auto summary = run_sequence(request_, [](std::size_t done, std::size_t total) {
    EXPECT_EQ(total, 5U);
    return done < 3;
  });
  EXPECT_TRUE(summary->interrupted);
  EXPECT_EQ(summary->report.num_frames, 3U);
  EXPECT_EQ(summary->report.first_frame, 1U);
  EXPECT_EQ(read_kitti_trajectory(request_.out_dir / "trajectory_kitti.txt")->size(), 3U);
  EXPECT_NEAR(summary->report.metrics->path_length_m, 2 * kStep_m, 1e-6);
}

TEST_F(PipelineRun, StoppingAfterTheLastFrameIsNoInterrupt) {
  const auto summary =
      run_sequence(request_, [](std::size_t done, std::size_t total) { return done < total; });
  ASSERT_TRUE(summary);
  EXPECT_FALSE(summary->interrupted);
}

TEST_F(PipelineRun, IsScoredFromWhereTheCameraStarts) {
  request_.config.scale_choice = ScaleChoice::kOptions;
  fs::resize_file(request_.sequence_dir / "image_0/000000.png", 200);
  cv::imwrite(request_.sequence_dir / "image_0/000001.png", cv::Mat::zeros(160, 320, CV_8U));
  EXPECT_NEAR(run_sequence(request_)->report.metrics->path_length_m, (kNumFrames - 3) * kStep_m,
              1e-6);
  const nlohmann::json page = report_content(read_all(request_.out_dir / "report.html"));
  EXPECT_EQ(page["truth"]["x"].size(), kNumFrames - 2U);
}

TEST_F(PipelineRun, WrongRequestsAreFoundBeforeWorkStarts) {
  RunRequest request = request_;
  request.config.scale.step_m = 0.0;
  EXPECT_THAT(error_of(request), HasSubstr("scale.step_m"));
  request = request_;
  request.config.stem.model = "nothing";
  EXPECT_THAT(error_of(request), HasSubstr("nothing"));
  request = request_;
  request.config.scale_choice = ScaleChoice::kGroundTruth;
  fs::remove(folder_ / "poses/07.txt");
  EXPECT_THAT(error_of(request), HasSubstr("expected a true pose of every frame"));
  EXPECT_FALSE(fs::exists(request_.out_dir));
  request = request_;
  request.out_dir = request_.sequence_dir / "calib.txt";
  EXPECT_THAT(error_of(request), HasSubstr("calib.txt: expected an output folder"));
}

TEST_F(PipelineRun, OneResultThatCannotBeWrittenDoesNotLoseTheOthers) {
  request_.config.scale_choice = ScaleChoice::kOptions;
  fs::resize_file(request_.sequence_dir / "image_0/000003.png", 200);
  const auto summary = run_sequence(request_, [&](std::size_t, std::size_t) {
    fs::create_directories(request_.out_dir / "trajectory_map_tum.txt.unfinished");
    fs::create_directories(request_.out_dir / "report.html");
    return true;
  });
  ASSERT_FALSE(summary->written);
  EXPECT_THAT(summary->written.error().message, HasSubstr("trajectory_map_tum.txt"));
  EXPECT_THAT(summary->warnings, ElementsAre(HasSubstr("000003.png")));
  EXPECT_EQ(read_kitti_trajectory(request_.out_dir / "trajectory_kitti.txt")->size(), 6U);
  EXPECT_TRUE(fs::is_regular_file(request_.out_dir / "metrics.json"));
  EXPECT_TRUE(fs::is_regular_file(request_.out_dir / "trajectory.png"));
}

}  // namespace
}  // namespace stemvo
