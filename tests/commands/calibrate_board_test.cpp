// SPDX-License-Identifier: MIT
// Photos of a chessboard become a camera file that a run takes.
#include "support/program_test.hpp"
#include "support/rendered_board.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

using Json = nlohmann::json;

class CalibrateBoard : public ::testing::Test {
 protected:
  static constexpr int kNumPhotos = 8;

  void SetUp() override {
    Camera camera{260.0, 260.7, 162.5, 124.8, 320, 240, Distortion::kRadialTangential};
    camera.distortion_coefficients = {-0.28, 0.09, 0.0008, -0.0005};
    BoardCamera photographer(camera);
    const Print print = print_chessboard({7, 5}, 0.03);
    cv::RNG random(3);
    fs::create_directories(folder_ / "photos");
    for (int i = 0; i < kNumPhotos; ++i) {
      photographer.choose_pose(print, 0.4, random);
      files_.emplace_back(folder_ / "photos" / fmt::format("{}.png", i));
      cv::imwrite(files_.back(), photographer.photograph(print, 0.5, random));
    }
  }
  ProgramResult calibrate(const std::string& input,
                          const Words& more = {},
                          const std::string& board = "7x5:0.03") const {
    return run_stemvo({"calibrate", "--board", board, input, "--out", camera_}, more);
  }
  void expect_camera(const ProgramResult& result) const {
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const Json json = Json::parse(result.out, nullptr, false);
    ASSERT_TRUE(json.is_object()) << result.out;
    EXPECT_EQ(json["views"].size(), 1U * kNumPhotos);
    EXPECT_EQ(json["pictures"], kNumPhotos);
    const Json& fx = json["parameters"][0];  // of few small photos: as near as its sigma says
    EXPECT_LT(fx["sigma"].get<double>(), 5.0);
    EXPECT_NEAR(fx["value"].get<double>(), 260.0, 4.0 * fx["sigma"].get<double>());
    EXPECT_TRUE(fs::exists(json["coverage"].get<std::string>()));
  }

  TempFolder folder_;
  std::string photos_ = folder_ / "photos";
  std::string camera_ = folder_ / "camera.yaml";
  std::vector<fs::path> files_;
};

TEST_F(CalibrateBoard, PhotosAndVideosMakeACameraThatARunTakes) {
  expect_camera(calibrate(photos_, {"--json"}));
  const ProgramResult ran =
      succeeded(run_stemvo({"run", photos_, "--camera", camera_, "--out", folder_ / "out"}));
  EXPECT_THAT(ran.err, HasSubstr("30 frames per second are taken for granted"));
  const std::string video = folder_ / "photos.avi";
  write_video(video, 10.0, files_);
  expect_camera(calibrate(video, {"--json"}));
  EXPECT_THAT(calibrate(photos_).out,
              AllOf(HasSubstr("8 pictures, 8 with the board"), HasSubstr("photograph next:"),
                    HasSubstr("camera.yaml"), HasSubstr("camera_coverage.png")));
}

TEST_F(CalibrateBoard, WhatCannotBeIsOneLine) {
  expect_error(calibrate(photos_, {}, "7x5"), 1,
               {"--board: expected COLUMNSxROWS:SQUARE_M", "found '7x5'"});
  expect_error(calibrate(photos_, {"--camera", camera_}), 2, {"--board", "--camera"});
  expect_error(calibrate(photos_, {"--quiet"}, "charuco:7x5:0.03:0.02:NONE"), 1,
               {"expected a dictionary from DICT_4X4_50", "found 'NONE'"});
  expect_error(calibrate(folder_ / "none", {"--quiet"}), 1, {"none: expected a folder of images"});
}

}  // namespace
}  // namespace stemvo
