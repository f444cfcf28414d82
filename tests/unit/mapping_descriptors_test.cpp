// SPDX-License-Identifier: MIT
#include "mapping/descriptors.hpp"
#include "mapping/place_candidates.hpp"
#include "support/kept_places.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

/// Blobs that are the same where the image is drawn with another offset.
cv::Mat texture(cv::Point offset) {
  cv::Mat large(400, 600, CV_8U);
  cv::RNG random(7);
  random.fill(large, cv::RNG::UNIFORM, 0, 256);
  cv::GaussianBlur(large, large, {}, 2.0);
  return large(cv::Rect(100 + offset.x, 100 + offset.y, 320, 200)).clone();
}

std::vector<KeptCorner> corners_at(const std::vector<Eigen::Vector2f>& uv) {
  std::vector<KeptCorner> corners(uv.size());
  for (std::size_t i = 0; i < uv.size(); ++i) {
    corners[i].uv = uv[i];
  }
  return corners;
}

TEST(Descriptors, FollowWhatIsShown) {
  const ChannelImage image{texture({0, 0}), {}};
  const ChannelImage moved{texture({7, -3}), {}};
  const auto one = describe(image, corners_at({{100.0F, 80.0F}, {200.0F, 90.0F}}), 0.0);
  const auto other = describe(moved, corners_at({{93.0F, 83.0F}, {193.0F, 93.0F}}), 0.0);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_LE(differing_bits(one[i], other[i]), 4);
    EXPECT_NE(one[i], kNoDescriptor);
  }
  EXPECT_GT(differing_bits(one[0], other[1]), 70);
}

TEST(Descriptors, TurnWithTheImage) {
  const cv::Mat upright = texture({0, 0});
  // The camera is turned clockwise, so what it shows turns the other way.
  const double turn_rad = 0.3;
  const Eigen::Vector2f centre(160.0F, 100.0F);
  const Eigen::Rotation2Df turn(static_cast<float>(-turn_rad));
  cv::Mat turned;
  cv::warpAffine(upright, turned, cv::getRotationMatrix2D({160.0F, 100.0F}, 17.1887, 1.0),
                 upright.size());
  const Eigen::Vector2f uv(150.0F, 80.0F);
  const Eigen::Vector2f turned_uv = centre + turn * (uv - centre);
  const double roll = image_roll_rad(so3_exp({0.0, 0.0, turn_rad}));
  const auto one = describe({upright, {}}, corners_at({uv}), 0.0);
  const auto other = describe({turned, {}}, corners_at({turned_uv}), roll);
  EXPECT_LE(differing_bits(one[0], other[0]), 30);
  EXPECT_GT(differing_bits(one[0], describe({turned, {}}, corners_at({turned_uv}), 0.0)[0]), 40);
}

TEST(Descriptors, ShowFromFartherOffWhatIsSmaller) {
  const cv::Mat near = texture({0, 0});
  cv::Mat far;
  const double scale = kOtherScales[0];
  cv::resize(near, far, {}, scale, scale, cv::INTER_AREA);
  const Eigen::Vector2f uv(150.0F, 80.0F);
  const Eigen::Vector2f far_uv = (scale * (uv.array().cast<double>() + 0.5) - 0.5).cast<float>();
  const auto as_far = describe({far, {}}, corners_at({far_uv}), 0.0);
  EXPECT_GT(differing_bits(as_far[0], describe({near, {}}, corners_at({uv}), 0.0)[0]), 50);
  EXPECT_LE(differing_bits(as_far[0], describe({near, {}}, corners_at({uv}), 0.0, scale)[0]), 10);
}

TEST(Descriptors, PixelsAreTheInputs) {
  ChannelImage half{texture({0, 0}), {}};
  half.map.scale = {2.0, 2.0};
  half.map.offset_px = {0.5, 0.5};
  const ChannelImage whole{texture({0, 0}), {}};
  EXPECT_EQ(describe(half, corners_at({{200.5F, 160.5F}}), 0.0),
            describe(whole, corners_at({{100.0F, 80.0F}}), 0.0));
}

TEST(Descriptors, NoneAtTheBorder) {
  const ChannelImage image{texture({0, 0}), {}};
  const auto found =
      describe(image, corners_at({{3.0F, 80.0F}, {100.0F, 80.0F}, {318.0F, 80.0F}}), 0.0);
  ASSERT_EQ(found.size(), 3U);
  EXPECT_EQ(found[0], kNoDescriptor);
  EXPECT_NE(found[1], kNoDescriptor);
  EXPECT_EQ(found[2], kNoDescriptor);
  EXPECT_TRUE(describe(image, {}, 0.0).empty());
}

TEST(Descriptors, MatchesAreEachOthersAndClear) {
  DescribedPoints points({});
  std::vector<Descriptor> first;
  std::vector<Descriptor> second;
  for (int i = 0; i < 50; ++i) {
    first.push_back(points.draw());
    second.insert(second.begin(), points.changed(first.back(), 0.1));
  }
  first[3] = kNoDescriptor;
  second[49 - 4] = kNoDescriptor;
  second.push_back(second[49 - 5]);  // two like it: neither is clear
  const auto pairs = match_descriptors(first, second);
  EXPECT_EQ(pairs.size(), 47U);
  for (const auto& [i, j] : pairs) {
    EXPECT_EQ(j, 49 - i);
  }
}

TEST(PlaceIndex, FindsThePlaceAmongMany) {
  DescribedPoints points({});
  PlaceIndex index;
  std::vector<std::vector<Descriptor>> places(300);
  for (std::size_t i = 0; i < places.size(); ++i) {
    for (int k = 0; k < 150; ++k) {
      places[i].push_back(points.draw());
    }
    index.add(10 * static_cast<int>(i), places[i]);
  }
  for (std::size_t i = 0; i < places.size(); i += 23) {
    std::vector<Descriptor> query;
    for (std::size_t k = 0; k < 150; ++k) {
      query.push_back(k % 2 == 0 ? points.changed(places[i][k], 0.12) : points.draw());
    }
    const int number = 10 * static_cast<int>(i);
    const auto found = index.candidates(query, [](int) { return true; }, 3);
    ASSERT_FALSE(found.empty()) << number;
    EXPECT_EQ(found.front().keyframe, number);
    for (const PlaceCandidate& candidate :
         index.candidates(query, [&](int place) { return place < number; }, 3)) {
      EXPECT_LT(candidate.keyframe, number);
    }
  }
  std::vector<Descriptor> elsewhere;
  for (int k = 0; k < 150; ++k) {
    elsewhere.push_back(points.draw());
  }
  EXPECT_TRUE(index.candidates(elsewhere, [](int) { return true; }, 3).empty());
}

}  // namespace
}  // namespace stemvo
