// SPDX-License-Identifier: MIT
#include "support/rendered_frames.hpp"
#include "support/test.hpp"
#include "synth/drive.hpp"
#include "synth/renderer.hpp"
#include "synth/sensor.hpp"

namespace stemvo::synth {
namespace {

/// Light that is read as `value` (0 to 1).
double light_of(double value) {
  double low = 0.0;
  double high = 1.0;
  for (int i = 0; i < 40; ++i) {
    const double middle = 0.5 * (low + high);
    const bool is_below = static_cast<double>(chip::response(static_cast<float>(middle))) < value;
    (is_below ? low : high) = middle;
  }
  return low;
}

TEST(SmallChip, ResponseRisesAndCompressesHighlights) {
  EXPECT_EQ(chip::response(0.0F), 0.0F);
  EXPECT_NEAR(chip::response(1.0F), 1.0F, 1e-6F);
  EXPECT_GT(chip::response(0.1F) - chip::response(0.0F),
            2.0F * (chip::response(1.0F) - chip::response(0.9F)));
}

/// Even light: the deviation in electrons is that of photons and of reading, at any gain.
TEST(SmallChip, NoiseIsThatOfPhotonsAndReading) {
  for (const float exposure : {0.5F, 1.0F, 2.0F}) {
    for (const float level : {0.05F, 0.2F, 0.4F}) {
      const cv::Mat light(60, 80, CV_32FC3, cv::Scalar::all(level));
      const cv::Mat rgb = expose_chip(light, exposure, 7);
      const cv::Rect middle(35, 25, 10, 10);  // no vignette there
      std::vector<double> electrons;
      for (int seed = 0; seed < 30; ++seed) {
        const cv::Mat part = expose_chip(light, exposure, static_cast<std::uint64_t>(seed))(middle);
        for (int y = 0; y < part.rows; ++y) {
          for (int x = 0; x < part.cols; ++x) {
            const double value = part.at<cv::Vec3b>(y, x)[1] / 255.0;
            electrons.push_back(light_of(value) * static_cast<double>(chip::kFullWell / exposure));
          }
        }
      }
      cv::Scalar mean_of;
      cv::Scalar sigma;
      cv::meanStdDev(electrons, mean_of, sigma);
      const double mean = mean_of[0];
      // Eight bits add a twelfth of a squared step.
      const double value = static_cast<double>(
          chip::response(static_cast<float>(mean) * exposure / chip::kFullWell));
      const double step = (light_of(value + 1.0 / 255.0) - light_of(value)) *
                          static_cast<double>(chip::kFullWell / exposure);
      const double expected =
          mean + static_cast<double>(chip::kRead * chip::kRead) + step * step / 12.0;
      EXPECT_NEAR(sigma[0] * sigma[0], expected, 0.12 * expected) << exposure << ", " << level;
    }
  }
}

/// A step between two even halves is spread like a Gaussian's integral.
TEST(SmallChip, SpreadsPoints) {
  cv::Mat light(400, 41, CV_32FC3, cv::Scalar::all(0.1));
  light.colRange(21, 41).setTo(cv::Scalar::all(0.5));
  const cv::Mat rgb = expose_chip(light, 1.0F, 3);
  std::vector<double> profile;
  for (int x = 10; x < 32; ++x) {
    double mean = 0.0;
    for (int y = 150; y < 250; ++y) {
      mean += light_of(rgb.at<cv::Vec3b>(y, x)[1] / 255.0) / 100.0;
    }
    profile.push_back(mean);
  }
  const double rise = profile.back() - profile.front();
  double first = 0.0;
  double second = 0.0;
  for (std::size_t i = 1; i < profile.size(); ++i) {
    const double share = (profile[i] - profile[i - 1]) / rise;
    first += share * static_cast<double>(i);
    second += share * static_cast<double>(i * i);
  }
  EXPECT_NEAR(std::sqrt(second - first * first), chip::kSpread_px, 0.12);
}

/// A smaller part of each pixel sees finer texture.
TEST(SmallChip, GapsBetweenPixelsLeaveMoreContrast) {
  const Drive drive = make_own_drive(3, 3);
  const Camera camera = kitti_camera(0.25);
  const Textures textures(3);
  Scene scene(drive.world_from_camera[1].translation, {0.0, -0.8, 0.6}, 0.4);
  add_street(drive.road, drive.arcs_m[1], 1, scene);
  std::vector<const Face*> faces;
  for (const Face& face : scene.faces()) {
    faces.push_back(&face);
  }
  const Rigid3 pose(drive.world_from_camera[1].rotation, Vec3::Zero());
  const auto fine_contrast = [&](double fill) {
    const RenderedFrame frame = paint(faces, pose, camera, textures, {0, camera.height_px}, fill);
    cv::Mat coarse;
    cv::GaussianBlur(frame.rgb, coarse, {}, 1.0);
    return cv::norm(frame.rgb - coarse, cv::NORM_L2);
  };
  EXPECT_GT(fine_contrast(0.8), 1.03 * fine_contrast(1.0));
}

}  // namespace
}  // namespace stemvo::synth
