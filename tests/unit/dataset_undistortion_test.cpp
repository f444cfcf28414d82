// SPDX-License-Identifier: MIT
#include <opencv2/calib3d.hpp>

#include "dataset/frame_files.hpp"
#include "geometry/distortion.hpp"
#include "odometry/frame_view.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

struct NamedLens {
  const char* name;
  Camera camera;
};

void PrintTo(const NamedLens& named, std::ostream* out) { *out << named.name; }

Camera with_lens(Camera camera, Distortion distortion, const std::array<double, 12>& numbers) {
  camera.distortion = distortion;
  camera.distortion_coefficients = numbers;
  return camera;
}

std::vector<NamedLens> lenses() {
  const Camera euroc{458.654, 457.296, 367.215, 248.375, 752, 480};
  const Camera kinect{520.9, 521.0, 325.1, 249.7, 640, 480};
  const Camera fisheye{190.98, 190.97, 254.93, 256.9, 512, 512};
  const Camera strong{300.0, 310.0, 330.0, 235.0, 640, 480};
  const Distortion radial = Distortion::kRadialTangential;
  return {
      {"Euroc", with_lens(euroc, radial, {-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05, 0})},
      {"Kinect", with_lens(kinect, radial, {0.2312, -0.7849, -0.0033, -0.0001, 0.9172})},
      {"Tangential", with_lens(kinect, radial, {-0.1, 0.02, 0.01, -0.008, 0.001})},
      {"Rational", with_lens(kinect, radial, {0.4, -0.3, 0.001, -0.002, 0.05, 0.6, -0.2, 0.03})},
      {"ThinPrism",
       with_lens(kinect, radial,
                 {-0.1, 0.02, 0.001, 0.002, 0, 0.05, 0.01, 0, 0.003, -0.001, -0.002, 0.001})},
      {"Fisheye", with_lens(fisheye, Distortion::kEquidistant, {0.0034, 0.0007, -0.002, 0.0002})},
      {"PureFisheye", with_lens(strong, Distortion::kEquidistant, {})},
  };
}

cv::Matx33d matrix_of(const Camera& c) {
  return {c.fx_px, 0, c.cx_px, 0, c.fy_px, c.cy_px, 0, 0, 1};
}

/// OpenCV's own formulas, of a point on the plane z = 1.
cv::Point2d project_by_opencv(const Camera& camera, const Eigen::Vector2d& xy) {
  std::vector<cv::Point2d> result;
  if (camera.distortion == Distortion::kEquidistant) {
    cv::fisheye::distortPoints(std::vector<cv::Point2d>{{xy.x(), xy.y()}}, result,
                               matrix_of(camera), cv::Vec4d(camera.distortion_coefficients.data()));
  } else {
    cv::projectPoints(std::vector<cv::Point3d>{{xy.x(), xy.y(), 1.0}}, cv::Vec3d(), cv::Vec3d(),
                      matrix_of(camera), camera.distortion_coefficients, result);
  }
  return result.front();
}

class UndistortionTest : public ::testing::TestWithParam<NamedLens> {
 protected:
  const Camera lens_ = GetParam().camera;
  const FrameView undistortion_ = FrameView::create(lens_).value();
  const Camera view_ = undistortion_.camera();
};

/// The scene: a grid of round spots, in pixels of the view.
constexpr double kSpacing_px = 42.0;
constexpr double kFirst_px = 14.3;

double distance_to_spot(double at) {
  return at - (kFirst_px + kSpacing_px * std::round((at - kFirst_px) / kSpacing_px));
}

double brightness(const cv::Point2d& at) {
  constexpr double kSigma_px = 2.0;
  const double x = distance_to_spot(at.x);
  const double y = distance_to_spot(at.y);
  return 20.0 + 220.0 * std::exp(-0.5 * (x * x + y * y) / (kSigma_px * kSigma_px));
}

/// The scene as the lens shows it, each pixel where OpenCV says it comes from.
cv::Mat draw_through(const Camera& camera, const Camera& view) {
  cv::Mat image(camera.height_px, camera.width_px, CV_8UC1);
  std::vector<cv::Point2d> pixels;
  for (int i = 0; i < static_cast<int>(image.total()); ++i) {
    pixels.emplace_back(i % image.cols, i / image.cols);
  }
  std::vector<cv::Point2d> scene;
  const cv::TermCriteria exact(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 200, 1e-12);
  if (camera.distortion == Distortion::kEquidistant) {
    cv::fisheye::undistortPoints(pixels, scene, matrix_of(camera),
                                 cv::Vec4d(camera.distortion_coefficients.data()), cv::noArray(),
                                 matrix_of(view));
  } else {
    cv::undistortPoints(pixels, scene, matrix_of(camera), camera.distortion_coefficients,
                        cv::noArray(), matrix_of(view), exact);
  }
  for (int i = 0; i < static_cast<int>(image.total()); ++i) {
    image.at<std::uint8_t>(i / image.cols, i % image.cols) =
        cv::saturate_cast<std::uint8_t>(brightness(scene[static_cast<std::size_t>(i)]));
  }
  return image;
}

/// The centre of the brightness above the background, around a place.
cv::Point2d center_of_spot(const cv::Mat& image, const cv::Point2d& near) {
  const cv::Rect window(cvRound(near.x) - 9, cvRound(near.y) - 9, 19, 19);
  cv::Mat weight;
  image(window).convertTo(weight, CV_64F, 1.0, -20.0);
  const cv::Moments moments = cv::moments(weight);
  return {window.x + moments.m10 / moments.m00, window.y + moments.m01 / moments.m00};
}

TEST_P(UndistortionTest, SpotsComeToLieWhereAPinholeCameraShowsThem) {
  const cv::Mat image = undistortion_.apply(draw_through(lens_, view_));
  ASSERT_EQ(image.size(), cv::Size(view_.width_px, view_.height_px));
  double worst_px = 0.0;
  for (double v = kFirst_px; v < view_.height_px - 14; v += kSpacing_px) {
    for (double u = kFirst_px; u < view_.width_px - 14; u += kSpacing_px) {
      worst_px = std::max(worst_px, cv::norm(center_of_spot(image, {u, v}) - cv::Point2d(u, v)));
    }
  }
  EXPECT_LT(worst_px, 0.05);
  std::cout << worst_px << " px\n";
}

TEST_P(UndistortionTest, EveryPixelComesFromInsideAndTheViewIsAsWideAsThatAllows) {
  double margin_px = 1e9;  // of the rim of the view to that of the lens' image
  for (int v = 0; v < view_.height_px; ++v) {
    for (int u = 0; u < view_.width_px; ++u) {
      if (u % 50 != 0 && v % 50 != 0 && u != view_.width_px - 1 && v != view_.height_px - 1) {
        continue;
      }
      const cv::Point2d source = project_by_opencv(lens_, view_.normalize({1.0 * u, 1.0 * v}));
      margin_px = std::min({margin_px, source.x, source.y, view_.width_px - 1 - source.x,
                            view_.height_px - 1 - source.y});
    }
  }
  EXPECT_GE(margin_px, -1e-3);
  const double scale = view_.fx_px / lens_.fx_px;
  EXPECT_NEAR(view_.fy_px / lens_.fy_px, scale, 1e-9);
  EXPECT_GE(scale, 0.8 - 1e-9);
  EXPECT_LE(scale, 1.2);
  EXPECT_TRUE(margin_px < 0.01 || scale < 0.8 + 1e-9) << margin_px << " px at " << scale;
  EXPECT_EQ(view_.cx_px, lens_.cx_px);
  EXPECT_EQ(view_.cy_px, lens_.cy_px);
}

INSTANTIATE_TEST_SUITE_P(Lenses,
                         UndistortionTest,
                         ::testing::ValuesIn(lenses()),
                         [](const auto& named) { return named.param.name; });

TEST(Undistortion, NoDistortionChangesNothing) {
  const Camera camera{585.0, 586.0, 320.0, 240.0, 640, 480};
  cv::Mat image(480, 640, CV_8UC3);
  cv::randu(image, 0, 255);
  for (const Distortion model : {Distortion::kNone, Distortion::kRadialTangential}) {
    const auto undistortion = FrameView::create(with_lens(camera, model, {})).value();
    EXPECT_EQ(undistortion.camera().matrix(), camera.matrix());
    EXPECT_EQ(cv::norm(undistortion.apply(image), image, cv::NORM_INF), 0.0);
  }
}

TEST(Undistortion, CoefficientsThatTurnTheImageInsideOutAreRefused) {
  const Camera camera{500.0, 500.0, 320.0, 240.0, 640, 480};
  for (const double k1 : {-8.0, -1e6, 50.0, 1e300}) {
    EXPECT_THAT(
        message_of(FrameView::create(with_lens(camera, Distortion::kRadialTangential, {k1}))),
        ::testing::HasSubstr("distortion coefficients"));
  }
}

using dataset::make_mask;

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
  const auto view = FrameView::create(
      with_lens(camera_of(1920, 1080), Distortion::kRadialTangential, {-0.2, 0.05}));
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
}  // namespace stemvo
