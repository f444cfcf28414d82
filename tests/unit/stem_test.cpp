// SPDX-License-Identifier: MIT
#include "stem/stem.hpp"

#include <cstring>

#include "support/test.hpp"
#include "support/tiny_stem.hpp"

namespace stemvo {
namespace {

/// Frame sizes with and without a remainder by 4.
const std::vector<cv::Size> kSizes = {{96, 64}, {97, 66}, {94, 63}, {95, 61}};

Stem make_stem(const TinyStem& tiny, int sampling, int filter = -1) {
  return Stem::load_all({.model = tiny_model(tiny.name), .filter = filter, .sampling_px = sampling})
      .value();
}

/// The part of a channel whose windows lie inside the frame.
cv::Rect inside(const TinyStem& tiny, cv::Size frame, int sampling) {
  const auto first = [&](int before) { return (before + sampling - 1) / sampling; };
  const auto end = [&](int before, int size) {
    return (size + before - tiny.kernel) / sampling + 1;
  };
  const int x = first(tiny.padding[1]);
  const int y = first(tiny.padding[0]);
  return {x, y, end(tiny.padding[1], frame.width) - x, end(tiny.padding[0], frame.height) - y};
}

void expect_convolution(const TinyStem& tiny, int sampling) {
  const Stem stem = make_stem(tiny, sampling);
  for (const int type : {CV_8UC1, CV_8UC3}) {
    for (const cv::Size size : kSizes) {
      const cv::Mat frame = textured_frame(size, type);
      const auto expected = reference_channels(tiny, frame, sampling);
      const std::vector<Channel> channels = stem.apply_all(frame).value();
      ASSERT_EQ(channels.size(), expected.size());
      // At the stride itself the graph's own padding holds, everywhere.
      const bool native = sampling == tiny.stride;
      for (std::size_t i = 0; i < expected.size(); ++i) {
        const cv::Mat& values = channels[i].values;
        ASSERT_EQ(values.size(), expected[i].size());
        const cv::Rect part =
            native ? cv::Rect({0, 0}, values.size()) : inside(tiny, size, sampling);
        EXPECT_LE(relative_error(values(part), expected[i](part)), 1e-5)
            << size << " filter " << i << " type " << type;
        EXPECT_TRUE(cv::checkRange(values));
      }
      // The model's default filter is 1.
      const cv::Mat one = stem.apply(frame).value().values;
      EXPECT_EQ(cv::norm(one, channels[1].values, cv::NORM_INF), 0.0);
    }
  }
}

TEST(Stem, SamplingEqualsTheConvolutionWithTheSmallerStride) {
  for (const TinyStem& tiny : {kPlain4, kNorm4, kPadded3, kSame3, kPadded7}) {
    for (int sampling = tiny.stride; sampling > 0; sampling /= 2) {
      SCOPED_TRACE(fmt::format("{} at {}", tiny.name, sampling));
      expect_convolution(tiny, sampling);
    }
  }
}

TEST(Stem, ShiftedPassesSeeNoPaddingAndNoOtherSide) {
  // On a plain frame every output is the same, the border's too.
  for (const TinyStem& tiny : {kPlain4, kPadded3, kSame3, kPadded7}) {
    const Stem stem = make_stem(tiny, 1, 0);
    const auto channel = stem.apply(cv::Mat(61, 95, CV_8UC3, cv::Scalar(10, 200, 90)));
    const cv::Mat difference = channel->values - channel->values.at<float>(5, 5);
    EXPECT_LE(cv::norm(difference, cv::NORM_INF), 1e-4) << tiny.name;
  }
}

TEST(Stem, SameBytesForAnyNumberOfThreadsAndAnyHistory) {
  const Stem stem = make_stem(kNorm4, 1);
  const cv::Mat frame = textured_frame({131, 77}, CV_8UC3);
  const cv::Mat other = textured_frame({90, 50}, CV_8UC1);
  const int threads_before = cv::getNumThreads();
  cv::Mat first;
  for (const int threads : {1, 2, 3, 8}) {
    cv::setNumThreads(threads);
    ASSERT_TRUE(stem.apply(other));  // another size in between
    const auto channel = stem.apply(frame).value();
    first = first.empty() ? channel.values : first;
    ASSERT_EQ(channel.values.size(), first.size());
    EXPECT_EQ(std::memcmp(channel.values.data, first.data, first.total() * sizeof(float)), 0);
  }
  cv::setNumThreads(threads_before);
}

TEST(Stem, AnEnlargedFramesPixelsAreWhereTheyWere) {
  cv::Mat ramp(40, 60, CV_8UC1);
  for (int y = 0; y < ramp.rows; ++y) {
    for (int x = 0; x < ramp.cols; ++x) {
      ramp.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(2 * x + 3 * y);
    }
  }
  StemOptions options{.model = "gray"};
  const Stem gray = Stem::load(options).value();
  const Channel channel = gray.apply(ramp, 2).value();
  ASSERT_EQ(channel.values.size(), ramp.size() * 2);
  for (int row = 8; row < channel.values.rows - 8; ++row) {
    for (int column = 8; column < channel.values.cols - 8; ++column) {
      const Eigen::Vector2d uv = channel.map.to_input(Eigen::Vector2d(column, row));
      ASSERT_NEAR(channel.values.at<float>(row, column), 2.0 * uv.x() + 3.0 * uv.y(), 0.51);
    }
  }
  EXPECT_EQ(gray.frame_zoom(TrackingResolution::kInputZoomed), 1)
      << "its sampling is odd: nothing to gain";

  const Stem learned = Stem::load({}).value();
  EXPECT_EQ(learned.frame_zoom(TrackingResolution::kInput), 1);
  ASSERT_EQ(learned.frame_zoom(TrackingResolution::kInputZoomed), 2);
  const Channel fine = learned.apply(ramp, 2).value();
  EXPECT_EQ(fine.values.size(), ramp.size());
  EXPECT_EQ(fine.map.scale, Eigen::Vector2d::Ones());
  EXPECT_EQ(fine.map.offset_px, Eigen::Vector2d::Zero());
}

TEST(Stem, InputLayerAndGray) {
  StemOptions options{.model = "input_layer"};
  const auto colours = Stem::load_all(options);
  EXPECT_EQ(colours->info().num_filters, 3);
  EXPECT_EQ(colours->info().filter, 0);
  cv::Mat frame(2, 3, CV_8UC3, cv::Scalar(10, 20, 40));
  const auto channels = colours->apply_all(frame).value();
  ASSERT_EQ(channels.size(), 3U);
  EXPECT_EQ(channels[0].values.at<float>(1, 2), 10.0F);
  EXPECT_EQ(channels[1].values.at<float>(1, 2), 20.0F);
  EXPECT_EQ(channels[2].values.at<float>(1, 2), 40.0F);
  EXPECT_EQ(channels[2].map.scale, Eigen::Vector2d(1, 1));
  EXPECT_EQ(channels[2].map.offset_px, Eigen::Vector2d(0, 0));
  options.filter = 2;
  EXPECT_EQ(Stem::load_all(options)->apply(frame)->values.at<float>(0, 0), 40.0F);
  EXPECT_EQ(Stem::load_all(options)->apply(cv::Mat1b(2, 2, 7))->values.at<float>(0, 0), 7.0F);

  options.model = "gray";
  options.filter = -1;
  const auto gray = Stem::load_all(options);
  EXPECT_NEAR(gray->apply(frame)->values.at<float>(1, 1), 2.99 + 11.74 + 4.56, 1e-4);
  EXPECT_EQ(gray->apply(cv::Mat1b(2, 2, 7))->values.at<float>(0, 0), 7.0F);
}

std::string error_of(const std::string& model, int filter = -1, int sampling = 0) {
  return message_of(Stem::load_all({.model = model, .filter = filter, .sampling_px = sampling}));
}

TEST(StemErrors, NamesAndPaths) {
  EXPECT_EQ(error_of(tiny_model("plain_k4s4")), "no error");
  EXPECT_EQ(error_of("other"),
            "stem.model: expected default, paper, gray, input_layer, log, census or the path of an "
            ".onnx, found 'other'");
  EXPECT_THAT(error_of("/dev/zero"), HasSubstr("path of an .onnx, found '/dev/zero'"));
  EXPECT_THAT(error_of("/no/such.h5"), HasSubstr("path of an .onnx, found '/no/such.h5'"));
  EXPECT_THAT(error_of("/no/such.onnx"), HasSubstr("/no/such.onnx: cannot read: No such file"));
}

TEST(StemErrors, FilterAndSamplingNameTheAllowedValues) {
  const std::string plain = tiny_model("plain_k4s4");
  EXPECT_EQ(error_of(plain, 3), "stem.filter: expected 0 to 2 for " + plain + ", found 3");
  EXPECT_EQ(error_of(plain, -2), "stem.filter: expected 0 to 2 for " + plain + ", found -2");
  EXPECT_EQ(error_of("gray", 1), "stem.filter: expected 0 to 0 for gray, found 1");
  EXPECT_EQ(error_of("input_layer", 3), "stem.filter: expected 0 to 2 for input_layer, found 3");
  const std::string divisors = "stem.sampling_px: expected the model's stride 4 or a divisor of it";
  for (const int sampling : {3, 8, -1}) {
    EXPECT_EQ(error_of(plain, 0, sampling), divisors + ", found " + std::to_string(sampling));
  }
  EXPECT_EQ(error_of("gray", 0, 2),
            "stem.sampling_px: expected the model's stride 1 or a divisor of it, found 2");
  EXPECT_EQ(error_of(tiny_model("deep_k12s4"), 0, 2),
            "stem.sampling_px: expected the model's stride 4, found 2");
}

TEST(StemErrors, SmallFramesAndFixedSizes) {
  const Stem stem = make_stem(kPlain4, 2);
  EXPECT_EQ(stem.apply(cv::Mat1b(4, 4, 1))->values.size(), cv::Size(1, 1));
  EXPECT_EQ(stem.apply(cv::Mat1b(5, 6, 1))->values.size(), cv::Size(2, 1));
  EXPECT_THAT(stem.apply(cv::Mat1b(3, 9, 1)).error().message,
              HasSubstr("expected frames of at least 4x4, found 9x3"));
  EXPECT_EQ(stem.frame_zoom(TrackingResolution::kInputZoomed), 2);
  EXPECT_THAT(stem.apply(cv::Mat1b(1, 9, 1), 2).error().message,
              HasSubstr("at least 4x4, found 18x2"));
  const Stem fixed = make_stem(kFixed4, 2);
  EXPECT_EQ(fixed.frame_zoom(TrackingResolution::kInputZoomed), 1);
  EXPECT_EQ(fixed.apply(cv::Mat1b(32, 48, 1))->values.size(), cv::Size(23, 15));
  EXPECT_THAT(fixed.apply(cv::Mat1b(33, 48, 1)).error().message,
              HasSubstr("expected frames of 48x32, the model's fixed size, found 48x33"));
}

TEST(Stem, ADeepLayerHasItsOwnPixelMap) {
  const cv::Mat frame = textured_frame({96, 64}, CV_8UC3);
  const auto expected = reference_channels(kPlain4, frame, 4);
  StemOptions options{.model = tiny_model("deep_k12s4")};
  const auto deep = Stem::load_all(options);
  EXPECT_EQ(deep->info().layer, "deep");
  EXPECT_EQ(deep->info().sampling_px, 4);
  const auto channel = deep->apply_range(frame, 0, 1);
  ASSERT_EQ(channel->size(), 1U);
  EXPECT_EQ(channel->front().map.to_input({5, 5}), Eigen::Vector2d(21.5, 21.5));
  const cv::Mat1f values = channel->front().values;
  EXPECT_NEAR(values(5, 6), cv::mean(expected[0](cv::Rect(5, 4, 3, 3)))[0], 1e-3);
}

Channel hand_made(const std::string& model, const cv::Mat& frame) {
  return Stem::load({.model = model}).value().apply(frame).value();
}

TEST(HandMade, LaplacianOfGaussianSeesBlobsAndNoRamps) {
  cv::Mat1b ramp(60, 80);
  for (int u = 0; u < ramp.cols; ++u) {
    ramp.col(u) = 3 * u;
  }
  const cv::Mat inside = hand_made("log", ramp).values({10, 10, 60, 40});
  EXPECT_LT(cv::norm(inside, cv::NORM_INF), 1e-3);
  cv::Mat1b blob(60, 80, uchar{50});
  cv::circle(blob, {40, 30}, 3, 200, cv::FILLED);
  cv::Point least;
  const Channel channel = hand_made("log", blob);
  cv::minMaxLoc(channel.values, nullptr, nullptr, &least);
  EXPECT_EQ(least, cv::Point(40, 30));
  EXPECT_EQ(channel.map.scale, Eigen::Vector2d(1.0, 1.0));
}

TEST(HandMade, CensusKnowsNoOffsetAndHardlyAGain) {
  cv::Mat1b frame(60, 80);
  cv::theRNG().state = 1;
  cv::randu(frame, 40, 100);
  const cv::Mat plain = hand_made("census", frame).values;
  EXPECT_LT(cv::norm(plain, hand_made("census", frame + 30).values, cv::NORM_INF), 1e-3);
  const cv::Mat doubled = hand_made("census", frame * 2).values;
  EXPECT_LT(cv::norm(plain, doubled, cv::NORM_L2), 0.15 * cv::norm(plain, cv::NORM_L2));
  EXPECT_GT(cv::norm(plain, doubled, cv::NORM_INF), 0.0);
}

TEST(HandMade, OneChannelEachOfColourFramesToo) {
  const cv::Mat color(30, 40, CV_8UC3, cv::Scalar(10, 20, 30));
  for (const std::string model : {"gray", "log", "census"}) {
    EXPECT_EQ(hand_made(model, color).values.type(), CV_32FC1) << model;
  }
}

StemOptions options_of(const std::string& name, int filter = -1) {
  return {.model = tiny_model(name), .filter = filter};
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
    cv::Mat1d weights(4, 4);
    weights.forEach([&](double& w, const int* yx) { w = kNorm4.weight(o, 0, yx[0], yx[1]); });
    const double z = weights.dot(gray({2 * at, weights.size()}));
    power += z * z;
    own = o == filter ? z : own;
  }
  return own / std::sqrt(power);
}

TEST(StemFolded, AGrayGraphSeesTheUnroundedGrayOfAColourFrame) {
  const cv::Mat frame = textured_frame({97, 66}, CV_8UC3);
  cv::Mat3d colours;
  frame.convertTo(colours, CV_64F);
  cv::Mat1d gray;
  cv::transform(colours, gray, cv::Matx13d(0.299, 0.587, 0.114));
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
