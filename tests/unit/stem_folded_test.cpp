// SPDX-License-Identifier: MIT
#include "stem/stem.hpp"
#include "support/test.hpp"
#include "support/tiny_stem.hpp"

namespace stemvo {
namespace {

StemOptions options_of(const std::string& name, int filter = -1) {
  StemOptions options{.model = tiny_model(name), .filter = filter};
  return options;
}

TEST(StemFolded, OneFilterAloneHasTheSameBytes) {
  for (const int type : {CV_8UC1, CV_8UC3}) {
    // With and without a remainder by 4; the last is computed in strips of rows.
    for (const cv::Size size : {cv::Size(96, 64), {97, 66}, {94, 63}, {95, 61}, {800, 93}}) {
      const cv::Mat frame = textured_frame(size, type);
      const auto folded = Stem::load(options_of("gray_k4s4_filter_1"));
      const auto all = Stem::load_all(options_of("gray_k4s4"));
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
        const double weight = o == 0 ? 1.0 / 48.0 : kNorm4.weight(o, 0, y, x);
        z += weight * gray(2 * at.y + y, 2 * at.x + x);
      }
    }
    power += z * z;
    own = o == filter ? z : own;
  }
  return own / std::sqrt(power);
}

TEST(StemFolded, AGrayGraphSeesTheUnroundedGrayOfAColourFrame) {
  const cv::Mat frame = textured_frame({97, 66}, CV_8UC3);
  cv::Mat3d colours;
  frame.convertTo(colours, CV_64F);
  cv::Mat1d gray(frame.size());
  std::transform(colours.begin(), colours.end(), gray.begin(), [](const cv::Vec3d& rgb) {
    return 0.299 * rgb[0] + 0.587 * rgb[1] + 0.114 * rgb[2];
  });
  for (const int filter : {0, 1, 5}) {  // 1 has a file of its own
    const auto stem =
        Stem::load(options_of(filter == 1 ? "gray_k4s4_filter_1" : "gray_k4s4", filter));
    const cv::Mat1f values = stem->apply(frame)->values;
    for (const cv::Point at : {cv::Point(0, 0), cv::Point(11, 7), cv::Point(46, 30)}) {
      EXPECT_NEAR(values(at), gray_response(gray, at, filter), 1e-5);
    }
  }
}

TEST(StemFolded, AFileOfOneFilterHasNoOthers) {
  EXPECT_THAT(message_of(Stem::load(options_of("gray_k4s4_filter_1", 2))),
              HasSubstr("expected a model of filter 2, found one of filter "
                        "1 alone"));
  const auto all = Stem::load_all(options_of("gray_k4s4_filter_1"));
  EXPECT_THAT(all.error().message, HasSubstr("expected a model of all 6 filters"));
}

TEST(StemFolded, TheDefaultFilterAloneIsThatOfTheDefaultModel) {
  const cv::Mat frame = textured_frame({96, 64}, CV_8UC1);
  const auto alone = Stem::load({});
  const auto all = Stem::load_all({});
  ASSERT_TRUE(alone && all);
  EXPECT_EQ(alone->info().filter, 0);
  EXPECT_EQ(alone->info().num_filters, 16);
  EXPECT_EQ(all->info().filter, 0);
  EXPECT_LT(cv::norm(alone->apply(frame)->values, all->apply(frame)->values, cv::NORM_INF), 1e-3);
}

}  // namespace
}  // namespace stemvo
