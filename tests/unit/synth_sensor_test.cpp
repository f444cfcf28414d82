// SPDX-License-Identifier: MIT
#include "support/rendered_frames.hpp"
#include "support/test.hpp"
#include "synth/basics.hpp"
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

/// Even light: the deviation in electrons is that of photons and of reading, at any gain.
TEST(SmallChip, NoiseIsThatOfPhotonsAndReading) {
  for (const float exposure : {0.5F, 1.0F, 2.0F}) {
    for (const float level : {0.05F, 0.2F, 0.4F}) {
      const cv::Mat light(60, 80, CV_32FC3, cv::Scalar::all(level));
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

constexpr double kRate_hz = 30.0;
constexpr double kTurn_rad_s = radians(60.0);

Camera small_camera() { return {292.5, 292.5, 160.0, 120.0, 320, 240}; }

/// A camera that turns to the right in the middle of the courtyard's first walkway.
Walk turning() {
  Walk walk = make_walk(2, 3, {.walk_rate_hz = kRate_hz});
  const Eigen::Vector3d at(walk.courtyard.x_m[0], -1.5, walk.courtyard.z_m[1]);
  walk.world_from_camera.clear();
  for (int i = 0; i < 5; ++i) {
    walk.world_from_camera.push_back(
        Rigid3::from_matrix(rotation(kTurn_rad_s * i / kRate_hz, 0.0, 0.0), at));
  }
  return walk;
}

cv::Mat render(const RenderOptions& options) {
  const Renderer renderer(turning(), small_camera(), 3, options);
  cv::Mat gray;
  gray_of(renderer.render(2)).convertTo(gray, CV_32F);
  return gray;
}

/// Mean over `length_px` in the row's direction.
cv::Mat smeared(const cv::Mat& image, double length_px) {
  constexpr int kSteps = 41;
  cv::Mat sum = cv::Mat::zeros(image.size(), CV_32F);
  for (int k = 0; k < kSteps; ++k) {
    const double shift = length_px * ((k + 0.5) / kSteps - 0.5);
    cv::Mat moved;
    const cv::Matx23d by(1.0, 0.0, shift, 0.0, 1.0, 0.0);
    cv::warpAffine(image, moved, by, image.size(), cv::INTER_CUBIC, cv::BORDER_REPLICATE);
    sum += moved / kSteps;
  }
  return sum;
}

double difference(const cv::Mat& a, const cv::Mat& b, const cv::Rect& where) {
  return cv::norm(a(where), b(where), cv::NORM_L2);
}

/// The length for which two images differ least, and by how much they do.
template <typename Difference>
std::pair<double, double> least_of(double first, double end, double step, const Difference& of) {
  std::pair<double, double> best(first, of(first));
  for (double at = first + step; at < end; at += step) {
    const double now = of(at);
    best = now < best.second ? std::pair(at, now) : best;
  }
  return best;
}

/// Near the image's middle a turn moves everything by f times the angle.
TEST(Shutter, BlursByExposureTimesFlow) {
  constexpr double kExposure_s = 0.03;
  const double expected_px = 292.5 * kTurn_rad_s * kExposure_s;
  ASSERT_GT(expected_px, 8.0);
  const cv::Mat sharp = render({.walk_rate_hz = kRate_hz});
  const cv::Mat blurred = render({.walk_rate_hz = kRate_hz, .exposure_s = kExposure_s});
  const cv::Rect middle(110, 80, 100, 80);
  const auto [best_px, least] = least_of(0.0, 2.0 * expected_px, 0.25, [&](double length_px) {
    return difference(smeared(sharp, length_px), blurred, middle);
  });
  EXPECT_NEAR(best_px, expected_px, 0.08 * expected_px);
  EXPECT_LT(least, 0.25 * difference(sharp, blurred, middle));
}

TEST(Shutter, ShearsByReadoutTimesFlow) {
  constexpr double kReadout_s = 0.03;
  const cv::Mat at_once = render({.walk_rate_hz = kRate_hz});
  const cv::Mat by_rows = render({.walk_rate_hz = kRate_hz, .readout_s = kReadout_s});
  for (const int row : {20, 70, 120, 170, 220}) {
    // A turn to the right moves everything to the left: later rows are further left.
    const double delay_s = kReadout_s * ((row + 0.5) / 240.0 - 0.5);
    const double expected_px = -292.5 * kTurn_rad_s * delay_s;
    const cv::Rect band(130, row - 6, 60, 13);
    const double best_px = least_of(-8.0, 8.05, 0.1, [&](double shift_px) {
                             cv::Mat moved;
                             const cv::Matx23d by(1.0, 0.0, shift_px, 0.0, 1.0, 0.0);
                             cv::warpAffine(at_once, moved, by, at_once.size(), cv::INTER_CUBIC);
                             return difference(moved, by_rows, band);
                           }).first;
    EXPECT_NEAR(best_px, expected_px, 0.35) << "row " << row;
  }
}

/// The camera looks one way, then another: its exposure is off at first and settles.
TEST(AutoExposure, FollowsTheLightWithDelay) {
  Walk walk = turning();
  const Rigid3 first = walk.world_from_camera.front();
  const auto mean_of = [](const Renderer& renderer, std::size_t i) {
    return cv::mean(gray_of(renderer.render(i)))[0];
  };
  // The brightest and the darkest view of eight, with constant exposure.
  walk.world_from_camera.clear();
  for (int k = 0; k < 8; ++k) {
    const Eigen::Matrix3d turned = rotation(kPi * k / 4.0, 0.0, 0.0);
    walk.world_from_camera.push_back(Rigid3::from_matrix(turned, first.translation));
  }
  const Renderer around(walk, small_camera(), 3);
  std::size_t bright = 0;
  std::size_t dark = 0;
  for (std::size_t k = 1; k < 8; ++k) {
    bright = mean_of(around, k) > mean_of(around, bright) ? k : bright;
    dark = mean_of(around, k) < mean_of(around, dark) ? k : dark;
  }
  ASSERT_GT(mean_of(around, bright), 1.15 * mean_of(around, dark));
  const Trajectory views = walk.world_from_camera;
  walk.world_from_camera.assign(60, views[dark]);
  std::fill(walk.world_from_camera.begin() + 5, walk.world_from_camera.end(), views[bright]);
  const Renderer follows(walk, small_camera(), 3,
                         {.walk_rate_hz = kRate_hz, .follows_light = true});
  const double before = mean_of(follows, 4);
  EXPECT_GT(mean_of(follows, 5), 1.1 * before) << "no delay";
  EXPECT_GT(mean_of(follows, 5), mean_of(follows, 15)) << "settles";
  EXPECT_NEAR(mean_of(follows, 59), before, 0.06 * before);
}

}  // namespace
}  // namespace stemvo::synth
