// SPDX-License-Identifier: MIT
#include "geometry/median.hpp"
#include "support/rendered_frames.hpp"
#include "support/test.hpp"
#include "synth/drive.hpp"
#include "synth/renderer.hpp"
#include "synth/traffic.hpp"

namespace stemvo::synth {
namespace {

const Camera kCamera = kitti_camera(0.25);

Renderer with_traffic(const Drive& drive, std::uint64_t seed) {
  return {drive, kCamera, seed, {.traffic = true}};
}

/// First and last frame of the first stand of at least 3 s; 0, 0: none.
std::pair<std::size_t, std::size_t> first_stand(const Drive& drive) {
  std::size_t begin = 0;
  for (std::size_t i = 1; i < drive.arcs_m.size(); ++i) {
    if (drive.arcs_m[i] - drive.arcs_m[begin] > 1e-6) {
      if (i - begin > 30) {
        return {begin, i - 1};
      }
      begin = i;
    }
  }
  return {0, 0};
}

/// Differences in gray levels between a frame and the next one, which is warped on to it as if
/// nothing moved: where the mask says that nothing does, and where it says that something does.
struct Differences {
  std::vector<double> still;
  std::vector<double> moving;

  Differences(const Renderer& renderer, std::size_t i) {
    const RenderedFrame a = renderer.render(i);
    const RenderedFrame b = renderer.render(i + 1);
    const auto& poses = renderer.world_from_camera();
    const cv::Mat map = predict(a, b, poses[i + 1].inverse() * poses[i], kCamera);
    cv::Mat warped;
    cv::Mat mask;
    cv::remap(gray_of(b), warped, map, {}, cv::INTER_CUBIC);
    cv::remap(b.moving, mask, map, {}, cv::INTER_NEAREST);
    cv::Mat near_moving;  // outlines are a mixture of both
    cv::dilate(a.moving | mask, near_moving, cv::Mat::ones(5, 5, CV_8U));
    cv::Mat inside_moving;
    cv::erode(a.moving, inside_moving, cv::Mat::ones(3, 3, CV_8U));
    const cv::Mat gray = gray_of(a);
    for (int y = 0; y < gray.rows; ++y) {
      for (int x = 0; x < gray.cols; ++x) {
        const double difference = std::abs(gray.at<uchar>(y, x) - warped.at<uchar>(y, x));
        const bool is_seen = map.at<cv::Vec2f>(y, x)[0] > -50.0F;
        if (is_seen && near_moving.at<uchar>(y, x) == 0) {
          still.push_back(difference);
        } else if (inside_moving.at<uchar>(y, x) != 0) {
          moving.push_back(difference);
        }
      }
    }
  }
};

/// Standing, what the mask leaves out changes by noise alone.
TEST(TrafficMask, IsWhereTheImageChangesWhileTheCameraStands) {
  int stands = 0;
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    const Drive drive = make_own_drive(260, seed, true);
    const auto [begin, end] = first_stand(drive);
    if (end == 0) {
      continue;
    }
    ++stands;
    const Renderer renderer = with_traffic(drive, seed);
    const auto& poses = renderer.world_from_camera();
    EXPECT_LT((poses[end].translation - poses[begin].translation).norm(), 1e-3);
    for (const std::size_t i : {begin + 8, begin + 20}) {
      Differences differences(renderer, i);
      ASSERT_GT(differences.moving.size(), 100U) << "nothing crosses, seed " << seed;
      std::ranges::sort(differences.still);
      // A few pixels see a little of something far away.
      EXPECT_LT(differences.still[differences.still.size() * 99 / 100], 9.0) << "seed " << seed;
      EXPECT_LT(median(differences.still), 3.0);
      EXPECT_GT(median(differences.moving), 2.0 * median(differences.still)) << "seed " << seed;
    }
  }
  EXPECT_GE(stands, 2);
}

/// Driving, the rest follows depth and poses.
TEST(TrafficMask, LeavesWhatFollowsTheStillScene) {
  for (const std::uint64_t seed : {1U, 4U}) {
    const Renderer renderer = with_traffic(make_own_drive(60, seed, true), seed);
    for (const std::size_t i : {5U, 40U}) {
      Differences differences(renderer, i);
      EXPECT_LT(median(differences.still), 6.0) << "seed " << seed << ", frame " << i;
      EXPECT_GT(median(differences.moving), 1.5 * median(differences.still))
          << "seed " << seed << ", frame " << i;
    }
  }
}

TEST(TrafficTest, FillsAThirdOfTheImageFromTheFirstFrameOn) {
  int lorries = 0;
  double most = 0.0;
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    const Renderer renderer = with_traffic(make_own_drive(30, seed, true), seed);
    const double share = cv::countNonZero(renderer.render(0).moving) /
                         static_cast<double>(kCamera.width_px * kCamera.height_px);
    lorries += share > 0.2 ? 1 : 0;
    most = std::max(most, share);
  }
  EXPECT_GE(lorries, 2);
  EXPECT_GT(most, 0.3);
  EXPECT_LT(most, 0.7);
}

}  // namespace
}  // namespace stemvo::synth
