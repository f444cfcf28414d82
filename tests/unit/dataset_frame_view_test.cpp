// SPDX-License-Identifier: MIT
#include "dataset/frame_files.hpp"
#include "geometry/distortion.hpp"
#include "odometry/frame_view.hpp"
#include "support/test.hpp"

namespace stemvo::dataset {
namespace {

Camera camera_of(int width_px, int height_px) {
  return {0.9 * width_px,        0.9 * width_px, 0.5 * width_px - 0.5,
          0.5 * height_px - 0.5, width_px,       height_px};
}

cv::Size working_size(int width_px, int height_px) {
  const Camera camera = working_camera(camera_of(width_px, height_px));
  return {camera.width_px, camera.height_px};
}

TEST(WorkingSize, OnlyLargeFramesAreMadeSmaller) {
  EXPECT_EQ(working_size(1241, 376), cv::Size(1241, 376));
  EXPECT_EQ(working_size(1280, 1024), cv::Size(1280, 1024));
  EXPECT_EQ(working_size(1920, 1080), cv::Size(1280, 720));
  EXPECT_EQ(working_size(3840, 2160), cv::Size(1280, 720));
  EXPECT_EQ(working_size(2448, 2048), cv::Size(979, 819));
  EXPECT_EQ(working_size(2000000, 1), cv::Size(1333333, 1)) << "a side never vanishes";
}

/// Where a dot is found in the small image is where the small camera sees its ray.
TEST(WorkingSize, TheCameraShrinksWithTheImage) {
  Camera camera = camera_of(2447, 2049);
  const auto view = FrameView::create(camera);
  cv::Mat image(2049, 2447, CV_8UC1, cv::Scalar(0));
  image(cv::Rect(300, 1500, 51, 51)) = 255;
  const cv::Mat small = view->apply(image);
  ASSERT_EQ(small.cols, view->camera().width_px);
  const cv::Moments moments = cv::moments(small);
  const Eigen::Vector2d centre(moments.m10 / moments.m00, moments.m01 / moments.m00);
  const Eigen::Vector2d ray = camera.normalize({325.0, 1525.0});
  EXPECT_LT((view->camera().project({ray.x(), ray.y(), 1.0}) - centre).norm(), 0.02);
}

TEST(Mask, RectanglesAndImages) {
  TempFolder temp;
  cv::Mat drawn(48, 64, CV_8UC1, cv::Scalar(255));
  drawn(cv::Rect(0, 0, 4, 4)) = 0;
  cv::imwrite(temp / "mask.png", drawn);
  const auto mask = make_mask({"10,40,20,100", temp / "mask.png"}, {64, 48});
  EXPECT_EQ(mask->at<unsigned char>(3, 3), 0);
  EXPECT_EQ(mask->at<unsigned char>(47, 29), 0);
  EXPECT_EQ(mask->at<unsigned char>(47, 30), 255);
  EXPECT_EQ(cv::countNonZero(*mask), 64 * 48 - 16 - 20 * 8);
  EXPECT_TRUE(make_mask({}, {64, 48})->empty());
}

TEST(Mask, WhatIsNone) {
  TempFolder temp;
  cv::imwrite(temp / "small.png", cv::Mat(4, 4, CV_8UC1, cv::Scalar(0)));
  const auto error_of = [](const std::string& part) {
    return message_of(make_mask({part}, {64, 48}));
  };
  EXPECT_THAT(error_of("64,0,5,5"), HasSubstr("64x48"));
  EXPECT_THAT(error_of("1,1,0,5"), HasSubstr("a rectangle inside"));
  EXPECT_THAT(error_of("0,0,64,48"), HasSubstr("that is left"));
  EXPECT_THAT(error_of("1,1,5"), HasSubstr("expected X,Y,WIDTH,HEIGHT in pixels of the frames, as "
                                           "0,300,1241,76, or an image, found 1,1,5: "));
  EXPECT_THAT(error_of("1,1,5,-5"), HasSubstr("a rectangle inside"));
  EXPECT_THAT(error_of(temp / "small.png"), HasSubstr("found 4x4"));
}

TEST(Mask, GoesTheWayOfTheFrames) {
  Camera camera = camera_of(1920, 1080);
  camera.distortion = Distortion::kRadialTangential;
  camera.distortion_coefficients = {-0.2, 0.05};
  const auto view = FrameView::create(camera);
  const auto mask = make_mask({"0,900,1920,180"}, {1920, 1080});
  const cv::Mat seen = view->apply_to_mask(*mask);
  cv::Mat frame(1080, 1920, CV_8UC1, cv::Scalar(0));
  frame(cv::Rect(0, 900, 1920, 180)) = 200;
  const cv::Mat bonnet = view->apply(frame) > 0;
  ASSERT_EQ(seen.size(), cv::Size(1280, 720));
  EXPECT_GT(cv::countNonZero(bonnet), 1280 * 60);
  EXPECT_EQ(cv::countNonZero(bonnet & seen), 0) << "no pixel of the bonnet is left";
  EXPECT_LT(cv::countNonZero(~bonnet & ~seen), 2 * 1280);
}

}  // namespace
}  // namespace stemvo::dataset
