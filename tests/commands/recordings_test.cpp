// SPDX-License-Identifier: MIT
#include "dataset/video_stream.hpp"
#include "evaluation/trajectory.hpp"
#include "support/matchers.hpp"
#include "support/program_test.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

constexpr int kNumFrames = 12;

/// One rendered drive as others record: its images, times and camera in their layouts.
class RecordingsRun : public DriveCopy {
 protected:
  RecordingsRun() : DriveCopy(kNumFrames) {}
  void SetUp() override { write_file(camera_, camera_file_of(sequence_)); }

  fs::path image(int index) const { return sequence_ / fmt::format("image_2/{:06}.png", index); }
  ProgramResult run(const std::string& input, const Words& more = {}) const {
    return run_stemvo({"run", input, "--out", out_}, more);
  }
  std::string poses() const { return read_file(out_ + "/trajectory_kitti.txt"); }
  std::string write_video() const {
    const std::string file = folder_ / "drive.avi";
    const std::set<fs::path> images(fs::directory_iterator(sequence_ / "image_2"), {});
    test::write_video(file, 10.0, {images.begin(), images.end()});
    return file;
  }

  const std::string camera_ = folder_ / "camera.yaml";
};

TEST_F(RecordingsRun, AVideoWithTruthByTime) {
  Trajectory truth = read_kitti_trajectory(folder_ / "poses/00.txt").value();
  truth.resize(kNumFrames);
  std::vector<double> times_s;
  for (int i = 0; i < kNumFrames; ++i) {
    times_s.push_back(0.1 * i);
  }
  ASSERT_TRUE(write_tum_trajectory(folder_ / "truth.txt", times_s, truth));
  const std::string video = write_video();
  const ProgramResult result =
      succeeded(run(video, {"--camera", camera_, "--gt", folder_ / "truth.txt", "--pictures", "5",
                            "--threads", "2"}));
  EXPECT_THAT(result.err, HasSubstr("input: video drive, frames of 620x188 pixels"));
  EXPECT_THAT(result.err, HasSubstr("ground truth for 12 of 12 frames"));
  EXPECT_EQ(metrics_of(out_).at("frames"), kNumFrames);
  EXPECT_LT(metrics_of(out_).at("ate_rmse_m").at("sim3").get<double>(), 0.5);
  EXPECT_TRUE(fs::exists(out_ + "/pictures/000010.png"));
  const std::string first = poses();
  succeeded(run(video, {"--camera", camera_, "--threads", "1"}));
  EXPECT_EQ(poses(), first) << "threads change nothing";
  succeeded(run(video, {"--camera", camera_, "--frames", "2:7"}));
  EXPECT_EQ(metrics_of(out_).at("frames"), 5);
}

TEST_F(RecordingsRun, AVideoWithTooFewTruePosesIsRefusedBeforeTheRun) {
  const std::string video = write_video();
  const std::string file = folder_ / "truth.txt";
  write_file(file, pose_lines(kNumFrames - 1));
  const ProgramResult result = run(video, {"--camera", camera_, "--gt", file});
  expect_error(result, 1, {"truth.txt: expected a pose for each of 12 frames", "found 11 poses"});
  EXPECT_FALSE(fs::exists(out_));
  succeeded(run(video, {"--camera", camera_, "--gt", file, "--frames", "0:11"}));
}

TEST_F(RecordingsRun, AVideoThatIsCutOff) {
  const std::string video = write_video();
  const std::string whole = read_file(video);
  const auto cut_to = [&](double share) {
    write_file(video, whole.substr(
                          0, static_cast<std::size_t>(share * static_cast<double>(whole.size()))));
    return run(video, {"--camera", camera_, "--quiet"});
  };
  const ProgramResult half = cut_to(0.5);
  EXPECT_THAT(half.exit_code, ::testing::AnyOf(0, 1));
  EXPECT_THAT(half.err, Not(HasSubstr("internal")));
  if (half.exit_code == 0) {
    EXPECT_THAT(half.err, HasSubstr("may be cut off"));
    EXPECT_LT(metrics_of(out_).at("frames"), kNumFrames);
  }
  expect_error(cut_to(0.02), 1, {"drive.avi"});
  expect_error(cut_to(0.0), 1, {"drive.avi"});
}

TEST_F(RecordingsRun, AVideoShowsFramesTracksAndPath) {
  const std::string avi = write_video();
  const std::string before = read_file(avi);
  fs::resize_file(image(5), 100);
  for (const auto& [input, name, more] : {std::tuple(sequence_.string(), "kitti.mp4", Words()),
                                          std::tuple(avi, "avi.mkv", Words{"--camera", camera_})}) {
    const ProgramResult result = run(input, joined({"--video", folder_ / name}, more));
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const auto stream = dataset::VideoStream::open(folder_ / name, {}).value();
    const dataset::VideoDecoder& video = stream->decoder();
    EXPECT_EQ(video.size, cv::Size(620 + 188 + 40, 188 + 40));
    EXPECT_NEAR(video.rate_hz, 10.0, 0.1);
    int count = 0;
    for (; video.grab(); ++count) {
      const cv::Mat shown = video.retrieve();
      cv::Mat apart = cv::imread(image(count), cv::IMREAD_COLOR);
      if (!apart.empty()) {
        cv::absdiff(shown(cv::Rect(0, 40, 620, 188)), apart, apart);
        EXPECT_LT(cv::mean(apart)[0], 25.0) << count;
      }
      const cv::Mat side = shown.colRange(620, shown.cols);
      cv::Mat path;
      cv::inRange(side, cv::Scalar(120, 60, 0), cv::Scalar(230, 150, 90), path);
      EXPECT_GT(cv::mean(side)[0], 200.0) << count;
      EXPECT_EQ(cv::countNonZero(path) > 300, count > 0) << count;
    }
    EXPECT_EQ(count, kNumFrames);
  }
  const std::string earlier = poses();
  EXPECT_THAT(earlier, Not(IsEmpty()));
  expect_error(run(avi, {"--camera", camera_, "--save-map", folder_ / "none/m.map"}), 1, {"m.map"});
  for (const fs::path& file :
       {fs::path(avi), folder_ / "video.txt", folder_ / "none/video.mp4", image(3)}) {
    expect_error(run(avi, {"--quiet", "--camera", camera_, "--video", file}), 1, {file});
  }
  EXPECT_EQ(read_file(avi), before);
  EXPECT_EQ(poses(), earlier) << "a wrong name costs no result";
}

TEST_F(RecordingsRun, WithoutOutResultsAreUnderTheirName) {
  const fs::path here = fs::current_path();
  fs::current_path(folder_.path());
  ::setenv("NO_COLOR", "1", 1);
  const ProgramResult result = run_stemvo({"run", sequence_.string(), "--frames", "0:3"});
  ::unsetenv("NO_COLOR");
  fs::current_path(here);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("results: results/00\n"));
  EXPECT_THAT(result.out + result.err, Not(HasSubstr("\x1b")));
  EXPECT_TRUE(fs::exists(folder_ / "results/00/trajectory_kitti.txt"));
}

}  // namespace
}  // namespace stemvo
