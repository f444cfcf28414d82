// SPDX-License-Identifier: MIT
#include <opencv2/calib3d.hpp>

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

/// OpenCV's own formulas, of a point on the plane z = 1.
cv::Point2d project_by_opencv(const Camera& camera, const cv::Point2d& xy) {
  const Camera& c = camera;
  const cv::Matx33d k(c.fx_px, 0, c.cx_px, 0, c.fy_px, c.cy_px, 0, 0, 1);
  std::vector<cv::Point2d> result;
  if (camera.distortion == Distortion::kEquidistant) {
    const cv::Vec4d coefficients(camera.distortion_coefficients.data());
    cv::fisheye::distortPoints(std::vector<cv::Point2d>{xy}, result, k, coefficients);
  } else {
    const std::vector<double> coefficients(camera.distortion_coefficients.begin(),
                                           camera.distortion_coefficients.end());
    cv::projectPoints(std::vector<cv::Point3d>{{xy.x, xy.y, 1.0}}, cv::Vec3d(), cv::Vec3d(), k,
                      coefficients, result);
  }
  return result.front();
}

class UndistortionTest : public ::testing::TestWithParam<NamedLens> {
 protected:
  const Camera lens_ = GetParam().camera;
  const FrameView undistortion_ = FrameView::create(lens_).value();
  const Camera view_ = undistortion_.camera();

  cv::Point2d source_of(double u, double v) const {
    const Eigen::Vector2d xy = view_.normalize({u, v});
    return project_by_opencv(lens_, {xy.x(), xy.y()});
  }
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
  const auto matrix = [](const Camera& c) {
    return cv::Matx33d(c.fx_px, 0, c.cx_px, 0, c.fy_px, c.cy_px, 0, 0, 1);
  };
  cv::Mat image(camera.height_px, camera.width_px, CV_8UC1);
  std::vector<cv::Point2d> pixels;
  for (int i = 0; i < static_cast<int>(image.total()); ++i) {
    pixels.emplace_back(i % image.cols, i / image.cols);
  }
  std::vector<cv::Point2d> scene;
  const cv::TermCriteria exact(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 200, 1e-12);
  if (camera.distortion == Distortion::kEquidistant) {
    cv::fisheye::undistortPoints(pixels, scene, matrix(camera),
                                 cv::Vec4d(camera.distortion_coefficients.data()), cv::noArray(),
                                 matrix(view));
  } else {
    const std::vector<double> coefficients(camera.distortion_coefficients.begin(),
                                           camera.distortion_coefficients.end());
    cv::undistortPoints(pixels, scene, matrix(camera), coefficients, cv::noArray(), matrix(view),
                        exact);
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

TEST_P(UndistortionTest, TheFormulasAreOpencvs) {
  for (double y = -0.6; y <= 0.6; y += 0.2) {
    for (double x = -0.7; x <= 0.7; x += 0.1) {
      const Eigen::Vector2d found = distort(lens_, {x, y});
      const cv::Point2d expected = project_by_opencv(lens_, {x, y});
      EXPECT_NEAR(lens_.fx_px * found.x() + lens_.cx_px, expected.x, 1e-6);
      EXPECT_NEAR(lens_.fy_px * found.y() + lens_.cy_px, expected.y, 1e-6);
    }
  }
}

TEST_P(UndistortionTest, EveryPixelComesFromInsideAndTheViewIsAsWideAsThatAllows) {
  double margin_px = 1e9;  // of the rim of the view to that of the lens' image
  for (int v = 0; v < view_.height_px; ++v) {
    for (int u = 0; u < view_.width_px; ++u) {
      if (u % 50 != 0 && v % 50 != 0 && u != view_.width_px - 1 && v != view_.height_px - 1) {
        continue;
      }
      const cv::Point2d source = source_of(u, v);
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

TEST_P(UndistortionTest, ColourIsUndistortedAsGrayIs) {
  cv::Mat gray(lens_.height_px, lens_.width_px, CV_8UC1);
  cv::randu(gray, 0, 255);
  cv::Mat color;
  cv::merge(std::vector<cv::Mat>{gray, gray, gray}, color);
  std::vector<cv::Mat> planes;
  cv::split(undistortion_.apply(color), planes);
  for (const cv::Mat& plane : planes) {
    EXPECT_EQ(cv::norm(plane, undistortion_.apply(gray), cv::NORM_INF), 0.0);
  }
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

}  // namespace
}  // namespace stemvo
