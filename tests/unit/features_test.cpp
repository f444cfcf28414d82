// SPDX-License-Identifier: MIT
#include "features/front_end.hpp"
#include "geometry/median.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

/// A smooth random texture seen from `shift` further to the right and below.
cv::Mat textured_image(cv::Size size, cv::Point2d shift) {
  cv::RNG random(7);
  cv::Mat noise(size.height + 64, size.width + 64, CV_32F);
  random.fill(noise, cv::RNG::NORMAL, 0.0, 1.0);
  cv::GaussianBlur(noise, noise, {}, 1.5);
  cv::normalize(noise, noise, 0.0, 255.0, cv::NORM_MINMAX);
  cv::Mat image;
  const cv::Matx23d crop(1.0, 0.0, 32.0 + shift.x, 0.0, 1.0, 32.0 + shift.y);
  cv::warpAffine(noise, image, crop, size, cv::INTER_CUBIC | cv::WARP_INVERSE_MAP);
  image.convertTo(image, CV_8U);
  return image;
}

ChannelImage image_of(const cv::Mat& image, double scale = 1.0, double offset_px = 0.0) {
  return {image, {Eigen::Vector2d::Constant(scale), Eigen::Vector2d::Constant(offset_px)}};
}

Matches matches_of(FrontEnd& front_end, const ChannelImage& image, const ImageClue& clue = {}) {
  return front_end.process(front_end.prepare(image, {}), clue);
}

double median_error_px(const Matches& matches, const Eigen::Vector2d& expected_flow) {
  std::vector<double> errors;
  for (std::size_t i = 0; i < matches.cur_uv.size(); ++i) {
    errors.push_back((matches.cur_uv[i] - matches.prev_uv[i] - expected_flow).norm());
  }
  return errors.empty() ? 1e9 : median(errors);
}

class FrontEndTest : public ::testing::TestWithParam<FeatureMethod> {
 protected:
  std::unique_ptr<FrontEnd> front_end_ = create_front_end({.method = GetParam()});
};

TEST_P(FrontEndTest, FindsAKnownShiftInInputPixels) {
  const cv::Size size(480, 200);
  const Matches none =
      matches_of(*front_end_, image_of(textured_image(size, {0.0, 0.0}), 2.0, 1.5));
  EXPECT_TRUE(none.cur_uv.empty());
  const Matches matches =
      matches_of(*front_end_, image_of(textured_image(size, {3.25, -1.75}), 2.0, 1.5));
  EXPECT_GT(matches.cur_uv.size(), 150U);
  EXPECT_LE(median_error_px(matches, {-6.5, 3.5}),
            GetParam() == FeatureMethod::kPatch || GetParam() == FeatureMethod::kKlt ? 0.15 : 1.5);
}

TEST_P(FrontEndTest, ABlankOrResizedImageStartsOver) {
  const cv::Mat blank(160, 320, CV_8U, cv::Scalar(90));
  matches_of(*front_end_, image_of(textured_image({320, 160}, {0.0, 0.0})));
  EXPECT_LT(matches_of(*front_end_, image_of(blank)).cur_uv.size(), 20U);
  EXPECT_TRUE(
      matches_of(*front_end_, image_of(textured_image({200, 100}, {0.0, 0.0}))).cur_uv.empty());
}

TEST_P(FrontEndTest, APartOfOneImageEndsTheTracksThereAndBeginsNone) {
  cv::Mat all_but_left(300, 480, CV_8UC1, cv::Scalar(1));
  all_but_left.colRange(0, 100) = 0;
  front_end_->set_mask(all_but_left);
  cv::Mat all_but_bottom(300, 480, CV_8UC1, cv::Scalar(255));
  all_but_bottom.rowRange(200, 300) = 0;
  const auto num_bottom = [](const std::vector<Eigen::Vector2d>& points) {
    return std::ranges::count_if(points, [](const Eigen::Vector2d& uv) { return uv.y() >= 202.0; });
  };
  const auto show = [&](int i, const cv::Mat& mask) {
    const cv::Mat image = textured_image({240, 150}, {1.0 * i, 0.0});
    const Matches matches =
        front_end_->process(front_end_->prepare(image_of(image, 2.0, 0.5), mask), {.frame = i});
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
                         FrontEndTest,
                         ::testing::Values(FeatureMethod::kPatch,
                                           FeatureMethod::kKlt,
                                           FeatureMethod::kOrb,
                                           FeatureMethod::kSift));

/// Where the matches of this track start; nullopt: it is none of them.
std::optional<Eigen::Vector2d> start_of(const Matches& matches, int track_id) {
  const auto found = std::ranges::find(matches.track_ids, track_id);
  return found == matches.track_ids.end()
             ? std::nullopt
             : std::optional(
                   matches.prev_uv[static_cast<std::size_t>(found - matches.track_ids.begin())]);
}

TEST(PatchFrontEnd, FollowsTheSamePointsUnderOneIdAndForgetsRejectedOnes) {
  const auto front_end = create_front_end({});
  const cv::Size size(480, 200);
  Matches first;
  for (int i = 0; i < 2; ++i) {
    first = matches_of(*front_end, image_of(textured_image(size, {1.0 * i, 0.0})));
  }
  std::vector<char> is_good(first.track_ids.size(), 1);
  ASSERT_GT(is_good.size(), 10U);
  is_good[3] = 0;
  front_end->remove_outliers(is_good);
  const Matches second = matches_of(*front_end, image_of(textured_image(size, {2.0, 0.0})));
  EXPECT_FALSE(start_of(second, first.track_ids[3]).has_value());
  int num_continued = 0;
  for (std::size_t i = 0; i < first.track_ids.size(); ++i) {
    if (const auto start = start_of(second, first.track_ids[i])) {
      ++num_continued;
      EXPECT_LT((*start - first.cur_uv[i]).norm(), 1e-6);
    }
  }
  EXPECT_GT(num_continued, static_cast<int>(first.track_ids.size()) / 2);
}

TEST(PatchFrontEnd, ATrackThatEndedIsFoundAgainWhereItIsExpectedOrForgotten) {
  const auto front_end = create_front_end({});
  const auto show = [&](double shift_px) {
    return matches_of(*front_end, image_of(textured_image({480, 200}, {shift_px, 0.0}), 2.0, 1.5));
  };
  static_cast<void>(show(0.0));
  const Matches first = show(1.0);
  const std::size_t n = first.track_ids.size();
  ASSERT_GT(n, 50U);
  // Every second track ends. Of those the first and each third after it is expected where it is,
  // the next too far away, the third not at all.
  std::vector<char> is_good(n, 1);
  Observations expected;
  for (std::size_t i = 0; i < n; i += 2) {
    is_good[i] = 0;
    const Eigen::Vector2d off(i % 6 == 0 ? 1.2 : 16.0, -0.8);
    if (i % 6 != 4) {
      expected.push_back({first.track_ids[i], first.cur_uv[i] + off});
    }
  }
  front_end->remove_outliers(is_good);
  front_end->expect_projections(expected, false);
  const Matches second = show(2.0);
  std::size_t num_found = 0;
  for (std::size_t i = 0; i < n; i += 2) {
    const auto start = start_of(second, first.track_ids[i]);
    EXPECT_TRUE(i % 6 == 0 || !start.has_value()) << i;
    num_found += start.has_value() ? 1 : 0;
    EXPECT_LT((start.value_or(first.cur_uv[i]) - first.cur_uv[i]).norm(), 0.6) << i;
  }
  EXPECT_GT(num_found, n / 8);  // of n / 6
  EXPECT_TRUE(std::ranges::is_sorted(second.track_ids));

  front_end->remove_outliers(std::vector<char>(second.track_ids.size(), 1));
  front_end->expect_projections({{first.track_ids[2], first.cur_uv[2] - Eigen::Vector2d(2.0, 0.0)}},
                                false);
  EXPECT_FALSE(start_of(show(3.0), first.track_ids[2]).has_value());  // it was not there once
}

TEST(PatchFrontEnd, WhatMayBeHiddenIsLookedForUntilItIsSeenAgain) {
  const auto front_end = create_front_end({});
  const cv::Mat image = textured_image({480, 200}, {0.0, 0.0});
  cv::Mat hidden = image.clone();
  hidden.colRange(0, 240).setTo(128);
  matches_of(*front_end, image_of(image));
  const Matches before = matches_of(*front_end, image_of(image));
  Observations expected;
  for (std::size_t i = 0; i < before.track_ids.size(); ++i) {
    expected.push_back({before.track_ids[i], before.cur_uv[i]});
  }
  for (const cv::Mat& seen : {hidden, hidden, hidden, image}) {
    matches_of(*front_end, image_of(seen));
    front_end->expect_projections(expected, /*may_hide=*/true);
  }
  const Matches after = matches_of(*front_end, image_of(image));
  EXPECT_GT(
      std::ranges::count_if(
          expected, [&](const auto& one) { return start_of(after, one.track_id).has_value(); }),
      0.9 * static_cast<double>(expected.size()));
}

TEST(PatchFrontEnd, WhatIsExpectedInTheDarkIsStillTrackedFromTheLastGoodImage) {
  const auto front_end = create_front_end({});
  const auto show = [&](const cv::Mat& image) { return matches_of(*front_end, image_of(image)); };
  const cv::Size size(480, 200);
  static_cast<void>(show(textured_image(size, {0.0, 0.0})));
  const Matches before = show(textured_image(size, {1.0, 0.0}));
  ASSERT_GT(before.track_ids.size(), 50U);
  Observations expected;
  for (std::size_t i = 0; i < before.track_ids.size(); ++i) {
    expected.push_back({before.track_ids[i], before.cur_uv[i]});
  }
  const cv::Mat dark(size, CV_8U, cv::Scalar(0));
  for (int i = 0; i < 3; ++i) {
    EXPECT_TRUE(show(dark).cur_uv.empty());
    front_end->expect_projections(expected, false);
  }
  const Matches after = show(textured_image(size, {2.0, 0.0}));
  EXPECT_GT(after.track_ids.size(), before.track_ids.size() / 2);
  EXPECT_LT(median_error_px(after, {-1.0, 0.0}), 0.05);
}

/// Texture of several sizes, seen from `shift_px` further to the right.
cv::Mat wide_texture(int shift_px) {
  const cv::Size size(960, 320);
  cv::RNG random(3);
  cv::Mat sum(size, CV_32F, cv::Scalar(0));
  for (const double sigma : {1.5, 6.0, 20.0}) {
    cv::Mat noise(size, CV_32F);
    random.fill(noise, cv::RNG::NORMAL, 0.0, 1.0);
    cv::GaussianBlur(noise, noise, {}, sigma);
    sum += 3.5 * sigma * noise;  // about the same contrast at all sizes
  }
  cv::normalize(sum, sum, 0.0, 255.0, cv::NORM_MINMAX);
  cv::Mat image;
  sum({shift_px, 0, 640, size.height}).convertTo(image, CV_8U);
  return image;
}

TEST(PatchFrontEnd, FindsAMotionBeyondTheLevelsAskedForOneLevelUp) {
  const auto front_end = create_front_end({.klt_levels = 3});
  matches_of(*front_end, image_of(wide_texture(0)));
  const Matches far = matches_of(*front_end, image_of(wide_texture(60)));
  EXPECT_GT(far.cur_uv.size(), 100U);
  EXPECT_LT(median_error_px(far, {-60.0, 0.0}), 0.05);
}

TEST(PatchFrontEnd, LooksAsFarOnAsTheIntervalIsLong) {
  const auto found_after_s = [](double interval_s) {
    const auto front_end = create_front_end({.klt_levels = 3});
    for (int i = 0; i < 3; ++i) {
      matches_of(*front_end, image_of(wide_texture(30 * i)), {i, 0.1 * i});
    }
    return matches_of(*front_end, image_of(wide_texture(180)), {3, 0.2 + interval_s});
  };
  const Matches found = found_after_s(0.4);  // three frames were dropped
  EXPECT_GT(found.cur_uv.size(), 100U);
  EXPECT_LT(median_error_px(found, {-120.0, 0.0}), 0.05);
  EXPECT_LT(found_after_s(0.1).cur_uv.size(), found.cur_uv.size() / 2);
}

TEST(PatchFrontEnd, LooksWhereTheTurnLeadsUnlessItLeadsNowhere) {
  const auto found_by = [](const std::optional<double>& last_shift_px) {
    const auto front_end = create_front_end({.klt_levels = 3});
    const auto show = [&](int shift_px, const std::optional<double>& turn_px) {
      ImageClue clue;
      if (turn_px) {
        clue.turn = Eigen::Matrix3d::Identity();
        (*clue.turn)(0, 2) = -*turn_px;
      }
      return matches_of(*front_end, image_of(wide_texture(shift_px)), clue);
    };
    for (int i = 0; i < 3; ++i) {
      static_cast<void>(show(30 * i, 30.0));
    }
    return show(190, last_shift_px);
  };
  const Matches right = found_by(130.0);
  EXPECT_GT(right.cur_uv.size(), 100U);
  EXPECT_LT(median_error_px(right, {-130.0, 0.0}), 0.05);
  const Matches unknown = found_by(std::nullopt);
  EXPECT_LT(unknown.cur_uv.size(), right.cur_uv.size() / 2);
  EXPECT_EQ(found_by(-200.0).track_ids, unknown.track_ids);
}

TEST(PatchFrontEnd, BandsOfShadowBetweenTwoImagesEndFewTracks) {
  const auto front_end = create_front_end({});
  const auto show = [&](int i, double shadow) {
    cv::Mat image = textured_image({480, 200}, {2.0 * i, 0.0});
    for (int x = 0; x < image.cols; ++x) {
      image.col(x) *= 1.0 - shadow * (0.5 + 0.5 * std::tanh(20.0 * std::sin(0.05 * x + i)));
    }
    return matches_of(*front_end, image_of(image), {.frame = i});
  };
  static_cast<void>(show(0, 0.0));
  const auto all = static_cast<double>(show(1, 0.0).cur_uv.size());
  const Matches matches = show(2, 0.7);
  EXPECT_GT(static_cast<double>(matches.cur_uv.size()), 0.75 * all);
  EXPECT_LT(median_error_px(matches, {-2.0, 0.0}), 0.1);
}

TEST(GridQuota, GivesEveryCellItsShare) {
  FeatureOptions options{.max_features = 24, .grid_columns = 4, .grid_rows = 3};
  GridQuota quota(options, {400, 300});
  EXPECT_TRUE(quota.take({10.0F, 10.0F}));
  EXPECT_TRUE(quota.take({20.0F, 20.0F}));
  EXPECT_FALSE(quota.take({30.0F, 30.0F}));
  EXPECT_TRUE(quota.take({399.9F, 299.9F}));
}

}  // namespace
}  // namespace stemvo
