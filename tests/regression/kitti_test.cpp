// SPDX-License-Identifier: MIT
#include "support/kitti_clips.hpp"
#include "support/state_runs.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

class Kitti : public NeedsClips, public ::testing::WithParamInterface<std::string> {};

TEST_P(Kitti, StaysInsideTheThresholdsWithTrueSteps) {
  hold(GetParam(), "ground_truth", "_true_steps.yaml", folder_ / "result");
}

TEST_P(Kitti, StaysInsideTheThresholdsFromTheCameraHeight) {
  hold(GetParam(), "camera_height", "_camera_height.yaml", folder_ / "result");
}

INSTANTIATE_TEST_SUITE_P(Clips,
                         Kitti,
                         ::testing::Values("00", "02", "03", "06"),
                         [](const auto& clip) { return clip.param; });

class SecondVisit : public NeedsClips {};

TEST_F(SecondVisit, BeginsWhereItBegan) {
  const std::string clip = shared_data() / "kitti/sequences/06";
  const std::string map = folder_ / "place.map";
  const auto t_rel_percent = [&](const std::string& option, const std::string& frames) {
    const auto done = run_stemvo(
        {"run", clip, "--frames", frames, option, map, "--out", folder_ / "result", "--quiet"});
    EXPECT_EQ(done.exit_code, 0) << done.err;
    EXPECT_THAT(done.err, Not(HasSubstr("no place of it")));
    return metrics_of(folder_ / "result").at("t_rel_percent").get<double>();
  };
  EXPECT_LT(t_rel_percent("--save-map", "0:51"), 1.0);
  EXPECT_LT(t_rel_percent("--map", "0:51"), 1.2) << "the steps until the place was recognized";
  EXPECT_LT(t_rel_percent("--map", "15:51"), 1.5);
  const auto elsewhere = run_stemvo({"run", shared_data() / "kitti/sequences/00", "--frames",
                                     "0:30", "--map", map, "--out", folder_ / "result", "--quiet"});
  EXPECT_THAT(elsewhere.err, HasSubstr("place.map: no place of it was seen"));
}

class RoadOfClip : public NeedsClips {
 protected:
  static constexpr int kFrames = 80;

  /// The first frames of clip 03, seen by a camera that is mounted otherwise.
  ProgramResult run(const std::function<void(cv::Mat&)>& turn,
                    double cx_px,
                    double cy_px,
                    const Words& more = {}) {
    const fs::path clip = shared_data() / "kitti/sequences/03";
    const fs::path images = folder_ / "images";
    fs::create_directories(images);
    cv::Size size;
    for (int i = 0; i < kFrames; ++i) {
      const std::string name = fmt::format("{:06}.png", i);
      cv::Mat image = cv::imread((clip / "image_0" / name).string(), cv::IMREAD_GRAYSCALE);
      turn(image);
      size = image.size();
      EXPECT_TRUE(cv::imwrite((images / name).string(), image));
    }
    std::ofstream(folder_ / "camera.yaml")
        << "image_width: " << size.width << "\nimage_height: " << size.height
        << "\ncamera_model: pinhole\nintrinsics: [721.54, 721.54, " << cx_px << ", " << cy_px
        << "]\ndistortion_model: none\ndistortion_coefficients: []\nrate_hz: 10\n"
           "camera_height: 1.65\n";
    return run_stemvo(
        {"run", images.parent_path().string(), "--out", folder_ / "result", "--quiet"}, more);
  }
  /// The path is in units.
  void expect_not_believed(const std::function<void(cv::Mat&)>& turn, double cx_px, double cy_px) {
    EXPECT_THAT(run(turn, cx_px, cy_px).err, HasSubstr("the path is in units, not metres"));
    EXPECT_EQ(believed(), 0.0);
  }
  [[nodiscard]] double believed() const {
    return metrics_of(folder_ / "result").at("road_believed_fraction");
  }
};

constexpr double kCx_px = 609.56;
constexpr double kCy_px = 172.85;
constexpr int kWidth = 1242;
constexpr int kHeight = 375;

TEST_F(RoadOfClip, IsBelievedByTheCameraAsItIs) {
  const ProgramResult done = succeeded(run([](cv::Mat&) {}, kCx_px, kCy_px));
  EXPECT_THAT(done.err, Not(HasSubstr("warning: scale")));
  EXPECT_GT(believed(), 0.85);
}

TEST_F(RoadOfClip, IsBelievedBeyondABonnetThatIsMasked) {
  const auto paint = [](cv::Mat& image) {
    cv::RNG(5).fill(image.rowRange(300, image.rows), cv::RNG::UNIFORM, 0, 255);
  };
  succeeded(run(paint, kCx_px, kCy_px, {"--mask", "0,300,1242,75"}));
  EXPECT_GT(believed(), 0.85);
}

TEST_F(RoadOfClip, IsNotBelievedUpsideDown) {
  const auto turn = [](cv::Mat& image) { cv::rotate(image, image, cv::ROTATE_180); };
  expect_not_believed(turn, kWidth - 1 - kCx_px, kHeight - 1 - kCy_px);
}

TEST_F(RoadOfClip, IsNotBelievedByACameraOnItsSide) {
  const auto turn = [](cv::Mat& image) {
    cv::rotate(image, image, cv::ROTATE_90_COUNTERCLOCKWISE);
  };
  expect_not_believed(turn, kCy_px, kWidth - 1 - kCx_px);
}

TEST_F(RoadOfClip, IsNotBelievedBySoFewGrayLevels) {
  expect_not_believed([](cv::Mat& image) { image = 126 + image / 64; }, kCx_px, kCy_px);
}

TEST_F(RoadOfClip, KeepsItsScaleOverFramesWithoutTexture) {
  int frame = 0;
  const auto dull = [&](cv::Mat& image) {
    if (frame >= 40 && frame < 60) {
      image = 126 + image / 64;
    }
    ++frame;
  };
  succeeded(run(dull, kCx_px, kCy_px));
  const Words states = test::column(read_file(folder_ / "result/frames.csv"), "scale_state");
  EXPECT_EQ(states[50], "held");
  const auto path = read_kitti_trajectory(folder_ / "result/trajectory_kitti.txt").value();
  const auto truth = read_kitti_trajectory(shared_data() / "kitti/poses/03.txt").value();
  const auto way = [](const Trajectory& poses) {
    return (poses[kFrames - 1].translation - poses[62].translation).norm();
  };
  EXPECT_NEAR(way(path) / way(truth), 1.0, 0.04);
}

class SigmaOfScale : public NeedsClips {};

TEST_F(SigmaOfScale, IsAsLargeAsTheErrors) {
  succeeded(run_stemvo({"run", (shared_data() / "kitti/sequences/03").string(), "--out",
                        folder_ / "result", "--quiet"}));
  const std::string csv = read_file(folder_ / "result/frames.csv");
  const Words sigmas = test::column(csv, "scale_sigma");
  const Words states = test::column(csv, "scale_state");
  const auto path = read_kitti_trajectory(folder_ / "result/trajectory_kitti.txt").value();
  const auto truth = read_kitti_trajectory(shared_data() / "kitti/poses/03.txt").value();
  const auto length = [](const Trajectory& poses, std::size_t from, std::size_t to) {
    double sum = 0.0;
    for (std::size_t i = from; i < to; ++i) {
      sum += (poses[i + 1].translation - poses[i].translation).norm();
    }
    return sum;
  };
  // Over 24 steps: the length of one has errors of its own.
  constexpr std::size_t kReach = 12;
  double squares = 0.0;
  int num = 0;
  for (std::size_t i = 2 * kReach; i + kReach < sigmas.size(); ++i) {
    if (states[i] == "measured") {
      const double log_ratio =
          std::log(length(path, i - kReach, i + kReach) / length(truth, i - kReach, i + kReach));
      squares += std::pow(log_ratio / std::stod(sigmas[i]), 2);
      ++num;
    }
  }
  ASSERT_GT(num, 300);
  EXPECT_GT(std::sqrt(squares / num), 0.5);
  EXPECT_LT(std::sqrt(squares / num), 2.0);
}

class HandHeld : public NeedsClips {};

TEST_F(HandHeld, ARoomHasNoRoad) {
  const ProgramResult done =
      succeeded(run_stemvo({"run", (shared_data() / "handheld").string(), "--out",
                            folder_ / "result", "--quiet", "--frames", "0:150", "--set",
                            "scale.source=camera_height", "--set", "scale.camera_height_m=1.5"}));
  EXPECT_THAT(done.err, HasSubstr("the path is in units, not metres"));
  EXPECT_LE(metrics_of(folder_ / "result")["ate_rmse_m"]["sim3"], 0.03) << "one unit";
}

TEST_F(HandHeld, ARoomUpsideDownHasNoRoad) {
  const fs::path clip = shared_data() / "handheld";
  fs::create_directories(folder_.path() / "images");
  fs::copy(clip / "camera.yaml",
           folder_.path() / "camera.yaml");  // its center is the image's, but for half a pixel
  for (const auto& entry : fs::directory_iterator(clip / "images")) {
    cv::Mat image = cv::imread(entry.path().string());
    cv::rotate(image, image, cv::ROTATE_180);
    cv::imwrite((folder_.path() / "images" / entry.path().filename()).string(), image);
  }
  const auto done =
      run_stemvo({"run", folder_.path().string(), "--out", folder_ / "result", "--quiet", "--set",
                  "scale.source=camera_height", "--set", "scale.camera_height_m=1.5"});
  EXPECT_THAT(done.err, HasSubstr("the path is in units, not metres"));
}

}  // namespace
}  // namespace stemvo
