// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include "models/manifest.hpp"
#include "stem/stem.hpp"
#include "support/temp_folder.hpp"
#include "support/tiny_stem.hpp"

namespace stemvo {
namespace {

using ::testing::HasSubstr;

StemOptions options_of(const std::string& model, int filter = -1) {
  StemOptions options;
  options.model = model;
  options.filter = filter;
  return options;
}

TEST(StemFolded, OneFilterAloneHasTheSameBytes) {
  const testing::TempFolder folder;
  testing::write_folded(folder);
  for (const int type : {CV_8UC1, CV_8UC3}) {
    // With and without a remainder by 4; the last is computed in strips of rows.
    for (const cv::Size size : {cv::Size(96, 64), {97, 66}, {94, 63}, {95, 61}, {800, 93}}) {
      const cv::Mat frame = testing::textured_frame(size, type);
      StemOptions options = options_of("gray_k4s4");
      const auto folded = Stem::create(with_network(options, folder.path()).value());
      const auto all = create_stem(options, folder.path());
      ASSERT_TRUE(folded && all);
      EXPECT_EQ(folded->info().num_filters, 6);
      const cv::Mat alone = folded->apply(frame)->values;
      const cv::Mat with_others = all->apply_range(frame, 1, 2)->front().values;
      ASSERT_EQ(alone.size(), with_others.size());
      EXPECT_EQ(cv::norm(alone, with_others, cv::NORM_INF), 0.0);
      EXPECT_EQ(folded->apply(frame)->map.to_input({3, 4}), Eigen::Vector2d(7.5, 9.5));
    }
  }
}

/// The formula of make_models.py, at one pixel of a channel sampled every 2 pixels.
double gray_response(const cv::Mat1d& gray, cv::Point at, int filter) {
  double power = 9.0;
  double own = 0.0;
  for (int o = 0; o < 6; ++o) {
    double z = 0.0;
    for (int y = 0; y < 4; ++y) {
      for (int x = 0; x < 4; ++x) {
        const double weight = o == 0 ? 1.0 / 48.0 : testing::kNorm4.weight(o, 0, y, x);
        z += weight * gray(2 * at.y + y, 2 * at.x + x);
      }
    }
    power += z * z;
    own = o == filter ? z : own;
  }
  return own / std::sqrt(power);
}

TEST(StemFolded, AGrayGraphSeesTheUnroundedGrayOfAColourFrame) {
  const testing::TempFolder folder;
  testing::write_folded(folder);
  const cv::Mat frame = testing::textured_frame({97, 66}, CV_8UC3);
  cv::Mat3d colours;
  frame.convertTo(colours, CV_64F);
  cv::Mat1d gray(frame.size());
  std::transform(colours.begin(), colours.end(), gray.begin(), [](const cv::Vec3d& rgb) {
    return 0.299 * rgb[0] + 0.587 * rgb[1] + 0.114 * rgb[2];
  });
  for (const int filter : {0, 1, 5}) {  // 1 has a file of its own
    const auto stem =
        Stem::create(with_network(options_of("gray_k4s4", filter), folder.path()).value());
    const cv::Mat1f values = stem->apply(frame)->values;
    for (const cv::Point at : {cv::Point(0, 0), cv::Point(11, 7), cv::Point(46, 30)}) {
      EXPECT_NEAR(values(at), gray_response(gray, at, filter), 1e-5);
    }
  }
}

TEST(StemFolded, ADamagedFileIsNotLoaded) {
  const testing::TempFolder folder;
  testing::write_folded(folder);
  (void)folder.file("gray_k4s4_filter_1.onnx", "no longer what it was");
  const auto error_of = [&](int filter) {
    const auto stem =
        Stem::create(with_network(options_of("gray_k4s4", filter), folder.path()).value());
    return stem ? "no error" : stem.error().message;
  };
  EXPECT_THAT(error_of(1), HasSubstr("gray_k4s4_filter_1.onnx: expected sha256 "));
  EXPECT_EQ(error_of(2), "no error");
  EXPECT_FALSE(check_model(find_layers("gray_k4s4", folder.path())->front()));
}

}  // namespace
}  // namespace stemvo
