// SPDX-License-Identifier: MIT
#include <opencv2/video/tracking.hpp>

#include "geometry/median.hpp"
#include "support/rendered_frames.hpp"
#include "support/test.hpp"
#include "synth/basics.hpp"
#include "synth/renderer.hpp"

namespace stemvo::synth {
namespace {

/// Offsets that tracking finds between frames and their successors warped on to them, in pixels.
struct Offsets {
  std::vector<double> dx;
  std::vector<double> dy;
  std::vector<double> length;

  void add(const Renderer& renderer, std::size_t i, const Camera& camera) {
    const RenderedFrame a = renderer.render(i);
    const RenderedFrame b = renderer.render(i + 1);
    const auto& poses = renderer.world_from_camera();
    const cv::Mat map = predict(a, b, poses[i + 1].inverse() * poses[i], camera);
    cv::Mat warped;
    cv::remap(gray_of(b), warped, map, {}, cv::INTER_CUBIC);
    std::vector<cv::Mat> xy;
    cv::split(map, xy);
    cv::Mat usable = xy[0] > -50.0F;
    cv::copyMakeBorder(usable, usable, 1, 1, 1, 1, cv::BORDER_CONSTANT, 0);
    cv::erode(usable, usable, cv::Mat::ones(17, 17, CV_8U));
    usable = usable(cv::Rect({1, 1}, map.size())).clone();
    std::vector<cv::Point2f> from;
    std::vector<cv::Point2f> to;
    std::vector<uchar> found;
    std::vector<float> residual;
    cv::goodFeaturesToTrack(gray_of(a), from, 800, 0.002, 5.0, usable);
    cv::calcOpticalFlowPyrLK(gray_of(a), warped, from, to, found, residual, {15, 15}, 0);
    for (std::size_t k = 0; k < from.size(); ++k) {
      if (found[k] != 0U) {
        dx.push_back(static_cast<double>(to[k].x - from[k].x));
        dy.push_back(static_cast<double>(to[k].y - from[k].y));
        length.push_back(std::hypot(dx.back(), dy.back()));
      }
    }
  }

  /// Depth and poses are exact: there is no motion left, not even a hundredth of a pixel.
  void expect_none() const {
    EXPECT_LE(median(length), 0.1);
    EXPECT_LE(std::abs(median(dx)), 0.01);
    EXPECT_LE(std::abs(median(dy)), 0.01);
  }
};

TEST(SyntheticImage, DepthAndPosesPredictTheNextFrame) {
  const Camera camera = kitti_camera(0.5);
  const Renderer renderer(make_own_drive(30, 3), camera, 3);
  Offsets offsets;
  for (const std::size_t i : {0U, 14U, 28U}) {
    offsets.add(renderer, i, camera);
  }
  ASSERT_GT(offsets.length.size(), 600U);
  offsets.expect_none();
}

/// Walking, looking aside, turning on the spot: surfaces are 0.6 to 6 m away.
TEST(SyntheticImage, DepthAndPosesPredictTheNextFrameOfAWalk) {
  const Renderer renderer(make_walk(600, 1, {.walk_rate_hz = 30.0}), hand_camera(), 1);
  Offsets offsets;
  for (std::size_t i = 10; i < 600; i += 97) {
    offsets.add(renderer, i, hand_camera());
  }
  ASSERT_GT(offsets.length.size(), 2000U);
  offsets.expect_none();
}

/// Deviation of the image between blurs of 1 and 8 px over part of the lane before the car.
double road_contrast(const cv::Mat& gray, double from_row) {
  cv::Mat image;
  cv::Mat fine;
  cv::Mat coarse;
  gray.convertTo(image, CV_32F);
  cv::GaussianBlur(image, fine, {}, 1.0);
  cv::GaussianBlur(image, coarse, {}, 8.0);
  const double w = gray.cols;
  const double h = gray.rows;
  const auto at = [](double x, double y) {
    return cv::Point(static_cast<int>(std::lround(x)), static_cast<int>(std::lround(y)));
  };
  const std::vector<cv::Point> trapezoid = {at(0.36 * w, h), at(0.64 * w, h),
                                            at(0.55 * w, 0.62 * h), at(0.45 * w, 0.62 * h)};
  cv::Mat mask = cv::Mat::zeros(gray.size(), CV_8U);
  cv::fillConvexPoly(mask, trapezoid, 255);
  mask.rowRange(0, static_cast<int>(from_row * h)).setTo(0);
  cv::Scalar mean;
  cv::Scalar deviation;
  cv::meanStdDev(fine - coarse, mean, deviation, mask);
  return deviation[0];
}

/// Gray levels, medians over clip 06 (straight, real), as docs/lab/rendered_against_real.md says.
constexpr double kRealContrast = 7.50;
constexpr double kRealContrastNear = 5.69;  // below 80 % of the height

TEST(SyntheticImage, RoadHasNoMoreContrastThanARealOne) {
  Trajectory straight;
  for (int i = 0; i < 40; ++i) {
    straight.emplace_back(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.0, 0.0, 1.1 * i));
  }
  for (const std::uint64_t seed : {1U, 2U}) {
    const Renderer renderer(make_drive_along(straight), kitti_camera(1.0), seed);
    const cv::Mat gray = gray_of(renderer.render(5 * seed));
    EXPECT_LE(road_contrast(gray, 0.0), kRealContrast);
    EXPECT_LE(road_contrast(gray, 0.8), kRealContrastNear);
    EXPECT_GE(road_contrast(gray, 0.0), 0.4 * kRealContrast) << "a road without texture";
  }
}

}  // namespace
}  // namespace stemvo::synth
