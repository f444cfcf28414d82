// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <ostream>
#include <set>
#include <string>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "robustness/disturbance.hpp"

namespace stemvo::robustness {

/// For the names of tests.
void PrintTo(const Disturbance& one, std::ostream* stream) { *stream << one.name; }

namespace {

constexpr std::size_t kNumFrames = 80;

/// Blurred noise that moves to the left, along a straight path.
FrameSource make_source(int type = CV_8UC1) {
  FrameSource frames;
  frames.name = "wall";
  frames.range = {0, kNumFrames};
  frames.camera = {600.0, 600.0, 319.5, 119.5, 640, 240};
  frames.ground_truth.emplace();
  for (std::size_t i = 0; i < kNumFrames; ++i) {
    frames.files.emplace_back(std::to_string(i) + ".png");
    frames.timestamps_s.push_back(0.1 * static_cast<double>(i));
    frames.ground_truth->emplace_back(Eigen::Quaterniond::Identity(),
                                      Eigen::Vector3d(static_cast<double>(i), 0.0, 0.0));
  }
  frames.read = [type](std::size_t index) -> Expected<cv::Mat> {
    cv::RNG random(7);
    cv::Mat wall(240, 640 + static_cast<int>(kNumFrames), CV_8UC1);
    random.fill(wall, cv::RNG::UNIFORM, 0, 256);
    cv::GaussianBlur(wall, wall, {}, 2.0);
    cv::normalize(wall, wall, 20, 235, cv::NORM_MINMAX);
    cv::Mat image = wall({static_cast<int>(index), 0, 640, 240}).clone();
    if (type == CV_8UC3) {
      cv::cvtColor(image, image, cv::COLOR_GRAY2RGB);
    }
    return image;
  };
  return frames;
}

double distance(const cv::Mat& a, const cv::Mat& b) {
  return cv::norm(a, b, cv::NORM_L1) / static_cast<double>(a.total());
}

void apply(std::string_view name, cv::Mat& image, double strength, const EffectContext& context) {
  find_disturbance(name)->apply(image, strength, context);
}

class EachDisturbance : public ::testing::TestWithParam<Disturbance> {
 protected:
  [[nodiscard]] static const Disturbance& kind() { return GetParam(); }
};

TEST_P(EachDisturbance, GivesTheSameBytesWhoeverReads) {
  const FrameSource source = make_source();
  const FrameSource forth = disturb(source, kind(), 2, 5);
  const FrameSource back = disturb(source, kind(), 2, 5);
  std::vector<cv::Mat> images;
  for (std::size_t i = 0; i < forth.size(); ++i) {
    images.push_back(*forth.read(i));
  }
  for (std::size_t i = back.size(); i-- > 0;) {
    EXPECT_EQ(distance(*back.read(i), images[i]), 0.0) << i;
  }
}

TEST_P(EachDisturbance, KeepsTypeAndCameraSize) {
  for (const int type : {CV_8UC1, CV_8UC3}) {
    for (std::size_t strength = 0; strength < 3; ++strength) {
      const FrameSource source = disturb(make_source(type), kind(), strength, 1);
      ASSERT_EQ(source.ground_truth->size(), source.size());
      ASSERT_EQ(source.timestamps_s.size(), source.size());
      const cv::Mat image = *source.read(source.size() / 2);
      EXPECT_EQ(image.type(), type);
      EXPECT_EQ(image.size(), cv::Size(source.camera.width_px, source.camera.height_px));
    }
  }
}

std::vector<Disturbance> those_of_images() {
  std::vector<Disturbance> kinds = disturbances();
  std::erase_if(kinds, [](const Disturbance& one) { return one.apply == nullptr; });
  return kinds;
}

std::string name_of(const ::testing::TestParamInfo<Disturbance>& one) {
  return std::string(one.param.name);
}

class EachEffect : public EachDisturbance {};

/// Effects change the image: more with every strength, and the last frames not at all.
TEST_P(EachEffect, DisturbsMoreWithItsStrengthAndLeavesTheEndCalm) {
  const FrameSource source = make_source();
  double before = 0.0;
  for (std::size_t strength = 0; strength < 3; ++strength) {
    const FrameSource disturbed = disturb(source, kind(), strength, 1);
    double change = 0.0;
    for (std::size_t i = 0; i < kNumFrames; ++i) {
      const double one = distance(*disturbed.read(i), *source.read(i));
      change += one;
      if (!kind().disturbs(i, kNumFrames, kind().strengths[strength])) {
        EXPECT_EQ(one, 0.0) << i;
      }
    }
    EXPECT_FALSE(kind().disturbs(kNumFrames - num_calm_frames(kNumFrames), kNumFrames, 1.0));
    EXPECT_GT(change, kind().name == "moving_third" ? 0.0 : before) << strength;  // it moves faster
    before = change;
  }
}

INSTANTIATE_TEST_SUITE_P(All, EachDisturbance, ::testing::ValuesIn(disturbances()), name_of);
INSTANTIATE_TEST_SUITE_P(All, EachEffect, ::testing::ValuesIn(those_of_images()), name_of);

TEST(Disturbances, HaveNamesOfTheirOwn) {
  std::set<std::string_view> names;
  for (const Disturbance& one : disturbances()) {
    EXPECT_TRUE(names.insert(one.name).second) << one.name;
    EXPECT_NE(one.apply == nullptr, one.resample == nullptr) << one.name;
  }
}

TEST(Disturbances, RandomOnesDependOnSeedAndFrame) {
  cv::Mat image(40, 60, CV_8UC1, cv::Scalar(100));
  const auto noisy = [&](std::size_t frame, std::uint64_t seed) {
    cv::Mat result = image.clone();
    apply("sensor_noise", result, 10.0, {frame, seed, {}});
    return result;
  };
  EXPECT_GT(distance(noisy(1, 1), noisy(2, 1)), 5.0);
  EXPECT_GT(distance(noisy(1, 1), noisy(1, 2)), 5.0);
  cv::Scalar mean;
  cv::Scalar deviation;
  cv::meanStdDev(noisy(1, 1), mean, deviation);
  EXPECT_NEAR(mean[0], 100.0, 1.0);
  EXPECT_NEAR(deviation[0], 10.0, 0.5);
}

/// Photon noise: variance grows with the light, and less light has the worse ratio.
TEST(Disturbances, DuskHasPhotonNoise) {
  const auto noise_over_signal = [](int gray, double light) {
    cv::Mat image(200, 200, CV_8UC1, cv::Scalar(gray));
    apply("dusk", image, light, {50, 1, {}});
    cv::Scalar mean;
    cv::Scalar deviation;
    cv::meanStdDev(image, mean, deviation);
    return deviation[0] / mean[0];
  };
  // 4000 electrons at white: 200 gray levels at a tenth are 314 electrons and 3 of read noise.
  EXPECT_NEAR(noise_over_signal(200, 0.1), std::sqrt(314.0 + 9.0) / 314.0, 0.006);
  EXPECT_GT(noise_over_signal(200, 0.01), 2.0 * noise_over_signal(200, 0.1));
}

/// Red stays red: a JPEG of the colours swapped has other brightness.
TEST(Disturbances, JpegKeepsColours) {
  cv::Mat image(64, 64, CV_8UC3, cv::Scalar(200, 40, 20));
  apply("jpeg", image, 30.0, {0, 0, {}});
  const cv::Scalar mean = cv::mean(image);
  EXPECT_NEAR(mean[0], 200.0, 4.0);
  EXPECT_NEAR(mean[1], 40.0, 4.0);
  EXPECT_NEAR(mean[2], 20.0, 4.0);
}

TEST(Disturbances, OtherFramesKeepTheirPosesAndTimes) {
  const FrameSource source = make_source();
  const auto kind = [](std::string_view name) {
    return *std::ranges::find(disturbances(), name, &Disturbance::name);
  };
  const FrameSource third = disturb(source, kind("every_nth"), 1, 1);
  ASSERT_EQ(third.size(), 27U);
  EXPECT_EQ((*third.ground_truth)[4].translation.x(), 12.0);
  EXPECT_EQ(distance(*third.read(4), *source.read(12)), 0.0);
  const FrameSource dropped = disturb(source, kind("dropped"), 2, 1);
  EXPECT_LT(dropped.size(), source.size());
  for (std::size_t i = 0; i < dropped.size(); ++i) {
    const auto frame = static_cast<std::size_t>((*dropped.ground_truth)[i].translation.x());
    EXPECT_EQ(distance(*dropped.read(i), *source.read(frame)), 0.0) << i;
  }
  const FrameSource repeated = disturb(source, kind("repeated"), 2, 1);
  ASSERT_EQ(repeated.size(), source.size());
  int num_repeated = 0;
  for (std::size_t i = 1; i < repeated.size(); ++i) {
    num_repeated += distance(*repeated.read(i), *repeated.read(i - 1)) == 0.0 ? 1 : 0;
  }
  EXPECT_GT(num_repeated, 5);
}

/// The same point of the world is where the other camera says it is.
TEST(Disturbances, OtherCamerasSeeTheSameRays) {
  const FrameSource source = make_source();
  for (const std::string_view name : {"cropped", "scaled"}) {
    const Disturbance& kind = *std::ranges::find(disturbances(), name, &Disturbance::name);
    const FrameSource other = disturb(source, kind, 1, 1);
    const cv::Mat image = *other.read(0);
    const cv::Mat whole = *source.read(0);
    double sum = 0.0;
    int count = 0;
    for (int v = 5; v + 5 < image.rows; ++v) {
      for (int u = 5; u + 5 < image.cols; ++u) {
        const Camera& from = other.camera;
        const Camera& to = source.camera;
        const cv::Point2f at(
            static_cast<float>((u - from.cx_px) / from.fx_px * to.fx_px + to.cx_px),
            static_cast<float>((v - from.cy_px) / from.fy_px * to.fy_px + to.cy_px));
        cv::Mat patch;
        cv::getRectSubPix(whole, {1, 1}, at, patch);
        sum += std::abs(patch.at<uchar>(0, 0) - image.at<uchar>(v, u));
        ++count;
      }
    }
    EXPECT_LT(sum / count, 4.0) << name;  // gray values; one pixel off is 12
  }
}

}  // namespace
}  // namespace stemvo::robustness
