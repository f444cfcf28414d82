// SPDX-License-Identifier: MIT
#include "stem/stem.hpp"
#include "support/test.hpp"
#include "support/tiny_stem.hpp"

namespace stemvo {
namespace {

Channel ramp(float low, float high) {
  Channel channel;
  channel.values.create(100, 200, CV_32F);
  for (int i = 0; i < 20000; ++i) {
    channel.values.at<float>(i / 200, i % 200) =
        low + (high - low) * static_cast<float>(i) / 19999.0F;
  }
  return channel;
}

TEST(ContrastNormalization, PercentilesBecomeBlackAndWhite) {
  StemOptions options{.contrast_low_percent = 10.0, .contrast_high_percent = 60.0};
  ContrastNormalization contrast(options);
  const ChannelImage image = contrast.apply(ramp(-3.0F, 7.0F));
  ASSERT_EQ(image.pixels.type(), CV_8UC1);
  const auto at_percent = [&](int percent) {
    const int i = 20000 * percent / 100;
    return static_cast<int>(image.pixels.at<unsigned char>(i / 200, i % 200));
  };
  EXPECT_EQ(at_percent(5), 0);
  EXPECT_NEAR(at_percent(10), 0, 1);
  EXPECT_NEAR(at_percent(35), 127.5, 1);
  EXPECT_NEAR(at_percent(60), 255, 1);
  EXPECT_EQ(at_percent(80), 255);
}

TEST(ContrastNormalization, LimitsFollowSlowly) {
  StemOptions options{
      .contrast_low_percent = 0.0, .contrast_high_percent = 100.0, .contrast_memory = 0.75};
  ContrastNormalization contrast(options);
  (void)contrast.apply(ramp(0.0F, 100.0F));
  // White moves from 100 to 0.75 * 100 + 0.25 * 107 = 101.75.
  const ChannelImage second = contrast.apply(ramp(0.0F, 107.0F));
  EXPECT_NEAR(second.pixels.at<unsigned char>(75, 0), 80.25 / 101.75 * 255.0, 1.0);
  const ChannelImage third = contrast.apply(ramp(0.0F, 107.0F));
  EXPECT_NEAR(third.pixels.at<unsigned char>(75, 0), 80.25 / 103.06 * 255.0, 1.0);
}

/// A lamp goes on, a tunnel ends: nothing of the new image is cut off or lost in a few gray values.
TEST(ContrastNormalization, LimitsJumpWithTheLight) {
  StemOptions options{.contrast_low_percent = 0.0, .contrast_high_percent = 100.0};
  ContrastNormalization contrast(options);
  const cv::Mat before = contrast.apply(ramp(0.0F, 100.0F)).pixels;
  for (const float white : {200.0F, 20.0F}) {
    const cv::Mat after = contrast.apply(ramp(0.0F, white)).pixels;
    EXPECT_LE(cv::norm(before, after, cv::NORM_INF), 1.0) << white;
  }
}

TEST(ContrastNormalization, NoContrastIsOneGrayAndForgotten) {
  ContrastNormalization contrast{StemOptions{}};
  Channel flat;
  flat.values = cv::Mat1f(20, 30, 5.0F);
  cv::Mat pixels = contrast.apply(flat).pixels;
  EXPECT_EQ(cv::norm(pixels, cv::Mat1b(20, 30, 128), cv::NORM_INF), 0.0);
  flat.values = cv::Mat1f(20, 30, 0.0F);
  EXPECT_EQ(cv::norm(contrast.apply(flat).pixels, cv::Mat1b(20, 30, 128), cv::NORM_INF), 0.0);

  const cv::Mat before = contrast.apply(ramp(0.0F, 10.0F)).pixels;
  (void)contrast.apply(flat);
  const cv::Mat after = contrast.apply(ramp(0.0F, 10.0F)).pixels;
  EXPECT_EQ(cv::norm(before, after, cv::NORM_INF), 0.0);
}

TEST(ContrastNormalization, NotANumberHarmsNobodyElse) {
  StemOptions options;
  ContrastNormalization clean(options);
  ContrastNormalization dirty(options);
  const cv::Mat expected = clean.apply(ramp(0.0F, 10.0F)).pixels;
  Channel broken = ramp(0.0F, 10.0F);
  broken.values.at<float>(50, 50) = std::numeric_limits<float>::quiet_NaN();
  broken.values.at<float>(50, 51) = std::numeric_limits<float>::infinity();
  const cv::Mat found = dirty.apply(broken).pixels;
  cv::Mat1b differs = expected != found;
  differs.at<unsigned char>(50, 50) = 0;
  differs.at<unsigned char>(50, 51) = 0;
  EXPECT_EQ(cv::countNonZero(differs), 0);
  EXPECT_EQ(found.at<unsigned char>(50, 50), 0);
}

/// What a low-pass channel shows of a street: bright above, dark below, blotches in between.
cv::Mat1f blotches() {
  cv::Mat1f values(180, 600);
  cv::RNG random(5);
  random.fill(values, cv::RNG::UNIFORM, 0.0, 1.0);
  cv::GaussianBlur(values, values, {}, 6.0);
  cv::normalize(values, values, 20.0, 120.0, cv::NORM_MINMAX);
  values.rowRange(0, 50) += 60.0;
  return values;
}

TEST(ContrastNormalization, PatchesKeepTheirGrayWhereTheExposureJumps) {
  for (const double gain : {0.7, 1.25, 1.8}) {
    ContrastNormalization contrast(StemOptions{});
    const cv::Mat1f scene = blotches();
    const cv::Mat before = contrast.apply({scene, {}}).pixels;
    const cv::Mat after = contrast.apply({cv::Mat1f(gain * scene + 12.0), {}}).pixels;
    EXPECT_LT(cv::norm(before, after, cv::NORM_INF), 3.0) << gain;
  }
}

TEST(ContrastNormalization, PatchesKeepTheirGrayWhereAThingPassesAndTheLightStays) {
  ContrastNormalization contrast(StemOptions{});
  const cv::Mat1f scene = blotches();
  const cv::Mat before = contrast.apply({scene, {}}).pixels;
  cv::Mat1f passing = scene.clone();
  passing.colRange(200, 380) += 50.0;
  const cv::Mat after = contrast.apply({passing, {}}).pixels;
  const cv::Rect beside(0, 0, 200, 180);
  EXPECT_LT(cv::norm(before(beside), after(beside), cv::NORM_INF), 8.0);
}

TEST(ContrastNormalization, HalfIsNativeWhereTheChannelIsOfThatSize) {
  for (const double sampling : {2.0, 3.0}) {  // no whole factor leads from 3 to 2
    Channel channel = ramp(0.0F, 1.0F);
    channel.map.scale = Eigen::Vector2d::Constant(sampling);
    channel.map.offset_px = Eigen::Vector2d(1.5, 0.5);
    StemOptions options{.tracking_resolution = TrackingResolution::kNative};
    const ChannelImage native = ContrastNormalization(options).apply(channel);
    options.tracking_resolution = TrackingResolution::kHalf;
    const ChannelImage half = ContrastNormalization(options).apply(channel);
    EXPECT_EQ(cv::norm(native.pixels, half.pixels, cv::NORM_INF), 0.0);
    EXPECT_EQ(native.map.scale, half.map.scale);
    EXPECT_EQ(native.map.offset_px, half.map.offset_px);
  }
}

/// Gray and the input's colours: half the size for every channel, or comparisons are not fair.
TEST(ContrastNormalization, HalfOfAFineChannelIsABinomialOfFourByFour) {
  Channel channel;
  channel.values.create(37, 51, CV_32F);
  cv::theRNG().state = 1;
  cv::randu(channel.values, 0.0, 255.0);
  StemOptions options{.tracking_resolution = TrackingResolution::kHalf,
                      .contrast_low_percent = 0.0,
                      .contrast_high_percent = 100.0};
  const ChannelImage half = ContrastNormalization(options).apply(channel);
  ASSERT_EQ(half.pixels.size(), cv::Size(25, 18));
  const Eigen::Vector2d centre = half.map.to_input({7.0, 3.0});
  EXPECT_EQ(centre, Eigen::Vector2d(14.5, 6.5));
  const cv::Mat weights = (cv::Mat_<float>(4, 1) << 0.125F, 0.375F, 0.375F, 0.125F);
  const double smooth = cv::Mat(weights * weights.t()).dot(channel.values({13, 5, 4, 4}));
  EXPECT_NEAR(half.pixels.at<unsigned char>(3, 7), smooth, 1.5);
}

/// Intensity-weighted centre of what is brighter than the middle.
Eigen::Vector2d centre_of(const cv::Mat& pixels) {
  cv::Mat1d weights;
  pixels.convertTo(weights, CV_64F);
  double darkest = 0.0;
  double brightest = 0.0;
  cv::minMaxLoc(weights, &darkest, &brightest);
  weights = cv::max(weights - 0.3 * darkest - 0.7 * brightest, 0.0);
  const cv::Moments moments = cv::moments(weights);
  return {moments.m10 / moments.m00, moments.m01 / moments.m00};
}

/// A bright spot is found at its input pixel.
void expect_spots(const TinyStem& tiny, int sampling, TrackingResolution resolution) {
  SCOPED_TRACE(fmt::format("{} at {}: {}", tiny.name, sampling, static_cast<int>(resolution)));
  const StemOptions options{.model = tiny_model(tiny.name),
                            .filter = 0,  // a box: the only symmetric one
                            .sampling_px = sampling,
                            .tracking_resolution = resolution,
                            .contrast_low_percent = 0.0,
                            .contrast_high_percent = 100.0};
  const Stem stem = Stem::load(options).value();
  for (const Eigen::Vector2d& spot :
       {Eigen::Vector2d(60.0, 45.0), Eigen::Vector2d(61.3, 43.8), Eigen::Vector2d(58.5, 47.25)}) {
    cv::Mat1b frame(90, 121);
    for (int y = 0; y < frame.rows; ++y) {
      for (int x = 0; x < frame.cols; ++x) {
        const double d2 = (Eigen::Vector2d(x, y) - spot).squaredNorm();
        frame(y, x) = cv::saturate_cast<unsigned char>(20.0 + 220.0 * std::exp(-d2 / 200.0));
      }
    }
    ContrastNormalization contrast(options);
    const auto channel = stem.apply(frame).value();
    const ChannelImage image = contrast.apply(channel);
    const Eigen::Vector2d found = image.map.to_input(centre_of(image.pixels));
    EXPECT_LE((found - spot).cwiseAbs().maxCoeff(), 0.05) << found.transpose();
    EXPECT_LE((image.map.from_input(found) - centre_of(image.pixels)).norm(), 1e-9);
    if (resolution == TrackingResolution::kNative) {
      EXPECT_EQ(image.pixels.size(), channel.values.size());
    }
    if (resolution == TrackingResolution::kHalf) {
      const cv::Size size = channel.values.size();
      EXPECT_EQ(image.pixels.size(), sampling == 1 ? size / 2 : size * (sampling / 2));
      EXPECT_EQ(image.map.scale, Eigen::Vector2d(2, 2));
    }
    if (resolution == TrackingResolution::kInput) {
      EXPECT_EQ(image.pixels.size(), channel.values.size() * sampling);
      EXPECT_EQ(image.map.scale, Eigen::Vector2d(1, 1));
    }
  }
}

TEST(ContrastNormalization, KeepsABrightSpotAtItsInputPixel) {
  using enum TrackingResolution;
  for (const int sampling : {4, 2, 1}) {
    expect_spots(kPlain4, sampling, kInput);
    expect_spots(kPlain4, sampling, kHalf);
  }
  for (const TinyStem& tiny : {kPadded3, kSame3, kPadded7}) {
    expect_spots(tiny, 2, kInput);
  }
  expect_spots(kPadded3, 1, kInput);
  expect_spots(kPadded7, 1, kInput);
  expect_spots(kPlain4, 2, kNative);
  expect_spots(kPadded3, 2, kNative);
}

TEST(Upsampling, AutoGoesByFeaturesAndFocalLength) {
  using enum TrackingResolution;
  const auto camera = [](double focal_px) {
    return Camera{focal_px, focal_px, 320, 240, 640, 480};
  };
  for (const FeatureMethod method : {FeatureMethod::kPatch, FeatureMethod::kKlt}) {
    EXPECT_EQ(choose_tracking_resolution(kAuto, method, camera(718)), kHalf);
    EXPECT_EQ(choose_tracking_resolution(kAuto, method, camera(500)), kHalf);
    EXPECT_EQ(choose_tracking_resolution(kAuto, method, camera(499)), kInputZoomed);
  }
  EXPECT_EQ(choose_tracking_resolution(kAuto, FeatureMethod::kOrb, camera(718)), kInput);
  EXPECT_EQ(choose_tracking_resolution(kAuto, FeatureMethod::kSift, camera(718)), kInput);
  for (const TrackingResolution asked : {kInput, kInputZoomed, kHalf, kNative}) {
    EXPECT_EQ(choose_tracking_resolution(asked, FeatureMethod::kKlt, camera(718)), asked);
    EXPECT_EQ(choose_tracking_resolution(asked, FeatureMethod::kOrb, camera(300)), asked);
  }
}

}  // namespace
}  // namespace stemvo
