// SPDX-License-Identifier: MIT
#include <cmath>

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include "calibration/patch_alignment.hpp"

namespace stemvo::calibration {
namespace {

/// Smooth texture, known everywhere.
double gray_at(const Eigen::Vector2d& uv) {
  return 128.0 + 40.0 * std::sin(0.31 * uv.x() + 0.11 * uv.y()) +
         35.0 * std::sin(0.07 * uv.x() - 0.37 * uv.y() + 1.0) +
         20.0 * std::cos(0.23 * uv.x() + 0.29 * uv.y());
}

/// The image whose pixel at `pose.uv + pose.linear * d` looks like the texture at `center + d`.
cv::Mat image_of(const Eigen::Vector2d& center, const PatchPose& pose, double gain) {
  cv::Mat image(120, 160, CV_8UC1);
  const Eigen::Matrix2d back = pose.linear.inverse();
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      const Eigen::Vector2d at = center + back * (Eigen::Vector2d(x, y) - pose.uv);
      image.at<unsigned char>(y, x) =
          cv::saturate_cast<unsigned char>(gain * (gray_at(at) - 128.0) + 120.0);
    }
  }
  return image;
}

const Eigen::Vector2d kCenter(70.3, 55.8);
const PatchPose kHere{kCenter, Eigen::Matrix2d::Identity()};

TEST(CalibrationPatch, IsFoundUnderAnAffineMapAndAnotherGain) {
  const auto patch = Patch::cut(image_of(kCenter, kHere, 1.0), kCenter);
  ASSERT_TRUE(patch.has_value());
  PatchPose truth{{84.7, 60.2}, Eigen::Matrix2d::Identity()};
  truth.linear << 1.15, 0.05, -0.04, 1.08;
  const cv::Mat image = image_of(kCenter, truth, 0.8);
  for (const Eigen::Vector2d& off :
       {Eigen::Vector2d(0.0, 0.0), Eigen::Vector2d(0.8, -0.6), Eigen::Vector2d(-0.5, 0.9)}) {
    const auto found = patch->find(image, {truth.uv + off, Eigen::Matrix2d::Identity() * 1.1});
    ASSERT_TRUE(found.has_value());
    EXPECT_LT((found->uv - truth.uv).norm(), 0.02);
    EXPECT_LT((found->linear - truth.linear).norm(), 0.02);
  }
}

TEST(CalibrationPatch, NothingIsFoundWhereNothingAlikeIs) {
  const cv::Mat image = image_of(kCenter, kHere, 1.0);
  const auto patch = Patch::cut(image, kCenter);
  ASSERT_TRUE(patch.has_value());
  EXPECT_FALSE(patch->find(cv::Mat(120, 160, CV_8UC1, cv::Scalar(90)), kHere).has_value());
  EXPECT_FALSE(patch->find(image, {{3.0, 50.0}, Eigen::Matrix2d::Identity()}).has_value());
  const double nan = std::nan("");
  EXPECT_FALSE(patch->find(image, {{nan, 50.0}, Eigen::Matrix2d::Identity()}).has_value());
}

TEST(CalibrationPatch, NeedsTextureAndRoom) {
  EXPECT_FALSE(Patch::cut(cv::Mat(120, 160, CV_8UC1, cv::Scalar(90)), kCenter).has_value());
  EXPECT_FALSE(Patch::cut(image_of(kCenter, kHere, 1.0), {4.0, 60.0}).has_value());
}

}  // namespace
}  // namespace stemvo::calibration
