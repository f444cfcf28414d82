// SPDX-License-Identifier: MIT
#include "mapping/descriptors.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

cv::Mat texture() {
  cv::Mat blobs(200, 320, CV_8U);
  cv::RNG(7).fill(blobs, cv::RNG::UNIFORM, 0, 256);
  cv::GaussianBlur(blobs, blobs, {}, 2.0);
  return blobs;
}

Descriptor described(const ChannelImage& image,
                     const Eigen::Vector2f& uv,
                     double roll_rad = 0.0,
                     double scale = 1.0) {
  std::vector<KeptCorner> corners(1);
  corners[0].uv = uv;
  return describe(image, corners, roll_rad, scale).at(0);
}

TEST(Descriptors, TurnWithTheImage) {
  const cv::Mat upright = texture();
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
  const Descriptor one = described({upright, {}}, uv);
  EXPECT_LE(differing_bits(one, described({turned, {}}, turned_uv, roll)), 30);
  EXPECT_GT(differing_bits(one, described({turned, {}}, turned_uv)), 40);
}

TEST(Descriptors, ShowFromFartherOffWhatIsSmaller) {
  const cv::Mat near = texture();
  cv::Mat far;
  const double scale = kOtherScales[0];
  cv::resize(near, far, {}, scale, scale, cv::INTER_AREA);
  const Eigen::Vector2f uv(150.0F, 80.0F);
  const Eigen::Vector2f far_uv = (scale * (uv.array().cast<double>() + 0.5) - 0.5).cast<float>();
  const Descriptor as_far = described({far, {}}, far_uv);
  EXPECT_GT(differing_bits(as_far, described({near, {}}, uv)), 50);
  EXPECT_LE(differing_bits(as_far, described({near, {}}, uv, 0.0, scale)), 10);
}

TEST(Descriptors, PixelsAreTheInputs) {
  ChannelImage half{texture(), {}};
  half.map.scale = {2.0, 2.0};
  half.map.offset_px = {0.5, 0.5};
  const ChannelImage whole{texture(), {}};
  EXPECT_EQ(described(half, {200.5F, 160.5F}), described(whole, {100.0F, 80.0F}));
}

}  // namespace
}  // namespace stemvo
