// SPDX-License-Identifier: MIT
#include "features/front_end.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

/// Blobs all over, seen through a channel of half the input's size.
ChannelImage textured(int shift_px) {
  cv::Mat noise(200, 300, CV_8UC1);
  cv::RNG rng(5);
  rng.fill(noise, cv::RNG::UNIFORM, 0, 256);
  cv::GaussianBlur(noise, noise, {}, 2.0);
  cv::normalize(noise, noise, 0, 255, cv::NORM_MINMAX);
  ChannelImage image;
  image.pixels = noise(cv::Rect(20 + shift_px, 20, 240, 150)).clone();
  image.map.scale = Eigen::Vector2d(2.0, 2.0);
  image.map.offset_px = Eigen::Vector2d(0.5, 0.5);
  return image;
}

class MaskedFrontEnd : public ::testing::TestWithParam<FeatureMethod> {};

TEST_P(MaskedFrontEnd, FindsNoPointsThere) {
  FeatureOptions options{.method = GetParam()};
  const auto num_below = [&](const cv::Mat& mask) {
    const auto front_end = create_front_end(options);
    front_end->set_mask(mask);
    (void)front_end->process(textured(0));
    const Matches matches = front_end->process(textured(1));
    EXPECT_GT(matches.prev_uv.size(), 20U);
    return std::count_if(matches.prev_uv.begin(), matches.prev_uv.end(),
                         [](const Eigen::Vector2d& uv) { return uv.y() >= 202.0; });
  };
  cv::Mat mask(300, 480, CV_8UC1, cv::Scalar(255));
  mask.rowRange(200, 300) = 0;  // of the input
  EXPECT_GT(num_below({}), 10);
  EXPECT_EQ(num_below(mask), 0);
}

TEST_P(MaskedFrontEnd, APartOfOneImageEndsTheTracksThereAndBeginsNone) {
  FeatureOptions options{.method = GetParam()};
  const auto front_end = create_front_end(options);
  cv::Mat all_but_left(300, 480, CV_8UC1, cv::Scalar(1));
  all_but_left.colRange(0, 100) = 0;
  front_end->set_mask(all_but_left);
  cv::Mat all_but_bottom(300, 480, CV_8UC1, cv::Scalar(255));
  all_but_bottom.rowRange(200, 300) = 0;
  const auto num_bottom = [](const std::vector<Eigen::Vector2d>& points) {
    return std::ranges::count_if(points, [](const Eigen::Vector2d& uv) { return uv.y() >= 202.0; });
  };
  const auto show = [&](int i, const cv::Mat& mask) {
    const Matches matches = front_end->process(front_end->prepare(textured(i), mask), {.frame = i});
    EXPECT_TRUE(std::ranges::all_of(matches.cur_uv, [](const Eigen::Vector2d& uv) {
      return uv.x() > 96.0;
    })) << i;
    return matches;
  };
  static_cast<void>(show(0, {}));
  EXPECT_GT(num_bottom(show(1, {}).cur_uv), 5);
  const Matches ended = show(2, all_but_bottom);
  EXPECT_GT(ended.cur_uv.size(), 20U);
  EXPECT_EQ(num_bottom(ended.cur_uv), 0);
  EXPECT_EQ(num_bottom(show(3, {}).prev_uv), 0);
  EXPECT_GT(num_bottom(show(4, {}).prev_uv), 5);
}

INSTANTIATE_TEST_SUITE_P(Methods,
                         MaskedFrontEnd,
                         ::testing::Values(FeatureMethod::kPatch,
                                           FeatureMethod::kOrb,
                                           FeatureMethod::kSift));

}  // namespace
}  // namespace stemvo
