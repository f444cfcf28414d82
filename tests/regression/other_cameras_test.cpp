// SPDX-License-Identifier: MIT
#include "evaluation/trajectory.hpp"
#include "support/kitti_clips.hpp"
#include "support/program_test.hpp"
#include "support/state_runs.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

/// Images of other people's cameras.
class OtherCameras : public NeedsClips {
 protected:
  void expect_poses(const Words& arguments, std::size_t count) const {
    const std::string out = folder_ / "out";
    const ProgramResult result = succeeded(run_stemvo({"run", "--out", out}, arguments));
    EXPECT_THAT(result.err, Not(HasSubstr("warning")));
    const auto poses = read_kitti_trajectory(out + "/trajectory_kitti.txt");
    ASSERT_TRUE(poses) << poses.error().message;  // it refuses what is not finite
    EXPECT_EQ(poses->size(), count);
  }
  [[nodiscard]] Words states() const {
    return column(read_file(folder_ / "out/frames.csv"), "state");
  }
  static std::size_t num_images(const fs::path& folder) {
    return static_cast<std::size_t>(
        std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
  }
};

/// The hand-held camera, its frames in an order of ours.
class Handheld : public OtherCameras {
 protected:
  fs::path camera_ = shared_data() / "handheld/camera.yaml";
  std::string seed_ = "1";

  /// Of the images in folder_: metrics.json.
  nlohmann::json expect_run(const fs::path& poses, std::size_t count) const {
    expect_poses({folder_ / "images", "--camera", camera_.string(), "--gt", poses.string(), "--set",
                  "scale.source=none", "--set", "seed=" + seed_},
                 count);
    return metrics_of(folder_ / "out");
  }

  /// Frames first, first + step, ..; the bounds are today's figures and half as much again.
  void expect_followed(int first, int step, std::size_t count, double max_ate_m) const {
    const fs::path data = shared_data() / "handheld";
    std::vector<fs::path> images(fs::directory_iterator(data / "images"), {});
    std::sort(images.begin(), images.end());
    std::istringstream lines(read_file(data / "poses.txt"));
    Words poses(images.size());
    for (std::string& pose : poses) {
      std::getline(lines, pose);
    }
    fs::create_directory(folder_ / "images");
    std::string chosen;
    for (std::size_t i = 0; i < count; ++i) {
      const auto from = static_cast<std::size_t>(first + step * static_cast<int>(i));
      fs::create_symlink(images[from], folder_ / fmt::format("images/{:06d}.jpg", i));
      chosen += poses[from] + "\n";
    }
    write_file(folder_ / "poses.txt", chosen);
    const auto metrics = expect_run(folder_ / "poses.txt", count);
    EXPECT_LE(metrics.at("ate_rmse_m").at("sim3").get<double>(), max_ate_m);
    EXPECT_GE(metrics.at("tracked_fraction").get<double>(), 0.97);
    if (count == images.size()) {  // the desk is seen again
      const auto& map = metrics.at("map");
      EXPECT_GE(map.at("loops").get<int>(), 1);
      EXPECT_TRUE(map.at("adjustment_s").is_number());
      EXPECT_LE(map.at("ate_rmse_m").at("sim3").get<double>(), 0.04);  // COLMAP's: 0.033
    }
    const Words seen = states();
    EXPECT_LE(std::find(seen.begin(), seen.end(), "tracking") - seen.begin(), 40);
    EXPECT_EQ(std::count(seen.begin(), seen.end(), "lost"), 0);
  }

  /// Two seconds see nothing; the map that begins then is joined to the one before, which the desk
  /// shows.
  void expect_joined(int first_black, double max_map_ate_m) const {
    const fs::path data = shared_data() / "handheld";
    const fs::path images = folder_ / "images";
    fs::create_directory(images);
    const cv::Mat black = cv::Mat::zeros(480, 640, CV_8U);
    for (int i = 0; i < 400; ++i) {
      const std::string name = fmt::format("{:06d}.jpg", i);
      if (i < first_black || i >= first_black + 60) {
        fs::create_symlink(data / "images" / name, images / name);
      } else {
        ASSERT_TRUE(cv::imwrite((images / name).string(), black));
      }
    }
    const auto metrics = expect_run(data / "poses.txt", 400);
    EXPECT_GE(metrics.at("map").at("loops").get<int>(), 1);
    EXPECT_LE(metrics.at("map").at("ate_rmse_m").at("sim3").get<double>(), max_map_ate_m);
    EXPECT_EQ(column(read_file(folder_ / "out/frames.csv"), "map_id").back(), "0");
  }
};

TEST_F(Handheld, Forwards) { expect_followed(0, 1, 400, 0.055); }
TEST_F(Handheld, Backwards) { expect_followed(399, -1, 400, 0.095); }
/// With this seed two planes that fit a little better than one motion made a map of one of them.
TEST_F(Handheld, TheDeskIsNoThingThatMoves) {
  camera_ = folder_ / "camera.yaml";
  seed_ = "4";
  write_file(camera_,
             "image_width: 640\nimage_height: 480\ncamera_model: pinhole\n"
             "intrinsics: [519.5, 519.5, 320.0, 240.0]\ndistortion_model: none\nrate_hz: 30\n");
  expect_followed(399, -1, 400, 0.06);
}
TEST_F(Handheld, BlackForTwoSeconds) { expect_joined(100, 0.1); }      // two maps: 0.29
TEST_F(Handheld, BlackSoonAfterTheStart) { expect_joined(40, 0.08); }  // two maps: 0.098
TEST_F(Handheld, EverySecondFrame) { expect_followed(0, 2, 200, 0.065); }
TEST_F(Handheld, EveryThirdFrame) { expect_followed(0, 3, 134, 0.055); }

TEST_F(OtherCameras, DroneOfEuroc) {
  const fs::path data = shared_data() / "euroc/mav0/cam0";
  expect_poses({(data / "data").string(), "--camera", (data / "sensor.yaml").string()},
               num_images(data / "data"));
  // It hovers: nothing to make a map of, and nothing is lost.
  EXPECT_THAT(states(), ::testing::Each(::testing::AnyOf("first", "stationary", "rotating")));
}

TEST_F(OtherCameras, KinectOfTum) {
  const fs::path images = shared_data() / "tum/rgb";
  write_file(folder_ / "camera.yaml",
             "image_width: 640\nimage_height: 480\ncamera_model: pinhole\n"
             "intrinsics: [520.9, 521.0, 325.1, 249.7]\ndistortion_model: radial-tangential\n"
             "distortion_coefficients: [0.2312, -0.7849, -0.0033, -0.0001, 0.9172]\nrate_hz: 10\n");
  expect_poses({images.string(), "--camera", folder_ / "camera.yaml"}, num_images(images));
  const Words seen = states();
  EXPECT_GE(std::count(seen.begin(), seen.end(), "tracking"), 15);
}

}  // namespace
}  // namespace stemvo
