// SPDX-License-Identifier: MIT
#include "evaluation/trajectory.hpp"
#include "support/program_test.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

/// Ten rendered frames as a folder of images; each test breaks them in its own way.
class ImageFolderRun : public DriveCopy {
 protected:
  void SetUp() override {
    fs::rename(sequence_ / "image_2", images_);
    write_file(camera_, good_camera_);
  }

  ProgramResult run_path(const std::string& path, const Words& more = {}) const {
    return run_stemvo({"run", path, "--out", out_}, more);
  }
  ProgramResult run(const Words& more = {}) const {
    return run_path(images_.string(), joined({"--camera", camera_}, more));
  }
  std::string config_key(const std::string& key) const {
    const std::string text = read_file(out_ + "/config.yaml");
    const std::size_t begin = text.find("  " + key + ": ") + key.size() + 4;
    return text.substr(begin, text.find('\n', begin) - begin);
  }

  const fs::path images_ = folder_.path() / "my images";
  const std::string camera_ = folder_ / "camera.yaml";
  const std::string good_camera_ = camera_file_of(sequence_) + "rate_hz: 10\n";
};

TEST_F(ImageFolderRun, NamesTheFolderAndTheCameraFile) {
  const ProgramResult result =
      run({"--gt", folder_ / "poses/00.txt", "--frames", "2:9"});  // 60 poses, 10 images
  expect_error(result, 1, {"00.txt", "10 images", "60 poses"});
  Trajectory ten = read_kitti_trajectory(folder_ / "poses/00.txt").value();
  ten.resize(10);
  ASSERT_TRUE(write_kitti_trajectory(folder_ / "ten.txt", ten));
  succeeded(run({"--gt", folder_ / "ten.txt", "--frames", "2:9"}));
  const auto metrics = metrics_of(out_);
  EXPECT_EQ(metrics.at("sequence"), "my images");
  EXPECT_EQ(metrics.at("frames"), 7);
  EXPECT_EQ(metrics.at("scale_source"), "none");
  EXPECT_EQ(metrics.at("alignment"), "sim3");
  EXPECT_THAT(read_file(out_ + "/config.yaml"),
              AllOf(HasSubstr("# frames 2:9 of my images"), HasSubstr("# calibration " + camera_)));
  EXPECT_THAT(read_file(out_ + "/trajectory_tum.txt"), StartsWith("0.200000000 "));
}

TEST_F(ImageFolderRun, ScaleComesFromTheCameraFileUnlessItWasChosen) {
  const std::string height = good_camera_ + "camera_height: 1.25\n";
  const auto expect_scale = [&](const Words& more, const std::string& source,
                                const std::string& height_m) {
    succeeded(run(joined({"--frames", "0:2"}, more)));
    EXPECT_EQ(config_key("source"), source);
    EXPECT_EQ(config_key("camera_height_m"), height_m);
  };
  write_file(folder_ / "my.yaml", "scale:\n  camera_height_m: 1.5\n  source: camera_height\n");
  expect_scale({}, "none", "1.65");
  expect_scale({"--set", "scale.source=camera_height"}, "camera_height", "1.65");
  expect_scale({"--set", "scale.source=constant_speed"}, "constant_speed", "1.65");
  expect_scale({"--config", folder_ / "my.yaml"}, "camera_height", "1.5");
  expect_scale({"--config", "fast"}, "none", "1.65");
  expect_scale({"--config", STEMVO_SOURCE_DIR "/config/default.yaml"}, "none", "1.65");
  expect_scale({"--set", "scale.camera_height_m=1.4"}, "camera_height", "1.4");
  expect_scale({"--set", "scale.camera_height_m=1.4", "--set", "scale.source=none"}, "none", "1.4");
  write_file(camera_, height);
  expect_scale({}, "camera_height", "1.25");
  expect_scale({"--set", "scale.source=none"}, "none", "1.25");
  expect_scale({"--config", folder_ / "my.yaml"}, "camera_height", "1.25");
  expect_scale({"--set", "scale.camera_height_m=1.75"}, "camera_height", "1.75");
}

TEST_F(ImageFolderRun, ACameraThatStandsStillIsSaidToDoSo) {
  EXPECT_THAT(run().out, Not(HasSubstr("hardly any")));
  for (const auto& file : fs::directory_iterator(images_)) {
    if (file.path().filename() != "000000.png") {
      fs::copy_file(images_ / "000000.png", file.path(), fs::copy_options::overwrite_existing);
    }
  }
  EXPECT_THAT(run().out, HasSubstr("hardly any (100.0 % of the frames in place)"));
}

TEST_F(ImageFolderRun, APatternThatTheShellReplaced) {
  Words names = {"--camera", camera_};
  for (int i = 1; i < 1000; ++i) {
    names.push_back((images_ / fmt::format("{:06}.png", i)).string());
  }
  const ProgramResult result = run_path((images_ / "000000.png").string(), names);
  expect_error(result, 2, {"not expected", "a pattern of files must be quoted", "--help"});
  EXPECT_LT(result.err.size(), 500U);
}

}  // namespace
}  // namespace stemvo
