// SPDX-License-Identifier: MIT
#include "odometry/frame_view.hpp"
#include "stemvo/odometry.hpp"
#include "support/synthetic_scene.hpp"
#include "support/test.hpp"
#include "support/tiny_stem.hpp"

namespace stemvo {
namespace {

constexpr Camera kCamera{200, 200, 159.5, 47.5, 320, 96};

std::string error_of(const Options& options, const Camera& camera = kCamera) {
  return message_of(Odometry::create(camera, options));
}

/// Blobs, so that there is something to track; another colour in each channel.
cv::Mat image_at(int frame) {
  cv::Mat image(96, 320, CV_8UC3, cv::Scalar(90, 100, 110));
  cv::RNG random(7);
  for (int i = 0; i < 150; ++i) {
    const cv::Point center(random.uniform(0, 340) - 2 * frame, random.uniform(0, 96));
    cv::circle(image, center, 3, cv::Scalar(random.uniform(0, 255), random.uniform(0, 255), i),
               cv::FILLED);
  }
  return image;
}

TEST(OdometryCreate, AnErrorAskedForItsValueThrowsItsMessage) {
  const auto odometry = Odometry::create({});
  EXPECT_THAT([&] { return odometry.value().keyframes(); },
              ::testing::ThrowsMessage<std::runtime_error>(odometry.error().message));
}

TEST(OdometryCreate, AnOptionOutOfRangeIsAnErrorThatNamesIt) {
  Options options;
  options.features.klt_window = 10;
  EXPECT_THAT(
      error_of(options),
      HasSubstr("features.klt_window: expected a whole number odd, from 3 to 201, found 10"));
  options = {};
  options.scale.camera_height_m = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(error_of(options), HasSubstr("scale.camera_height_m"));
  options = {};
  options.odometry.mode = static_cast<OdometryMode>(7);
  EXPECT_THAT(error_of(options), AllOf(HasSubstr("odometry.mode: expected one of two_frame, map"),
                                       HasSubstr("number 7")));
  options = {};
  options.stem.model = "resnet";
  EXPECT_THAT(error_of(options), AllOf(HasSubstr("stem.model"), HasSubstr("'resnet'")));
}

TEST(OdometryCreate, AMaskThatDoesNotFitIsRefusedAndOneThatDoesKeepsPointsAway) {
  const auto error_of_mask = [](const cv::Mat& mask) {
    return message_of(Odometry::create(kCamera, {}, mask));
  };
  EXPECT_THAT(error_of_mask(cv::Mat(95, 320, CV_8UC1)),
              HasSubstr("mask: expected 320x96 pixels of CV_8UC1, found 320x95 of CV_8UC1"));
  EXPECT_THAT(error_of_mask(cv::Mat(96, 320, CV_8UC3)), HasSubstr("found 320x96 of CV_8UC3"));
  cv::Mat right_half(96, 320, CV_8UC1, cv::Scalar(1));
  right_half.colRange(0, 161).setTo(0);  // a point moves by two pixels
  auto odometry = Odometry::create(kCamera, {}, right_half);
  for (int i = 0; i < 2; ++i) {
    ASSERT_TRUE(odometry->process(image_at(i), PixelOrder::kRgb, i));
  }
  ASSERT_FALSE(odometry->tracked_points().empty());
  for (const TrackedPoint& point : odometry->tracked_points()) {
    EXPECT_GE(point.uv.x(), 158.0);
  }
}

TEST(OdometryCreate, ALensIsTakenOutOfTheImagesAndTheMaskInside) {
  Camera distorted = kCamera;
  distorted.distortion = Distortion::kRadialTangential;
  distorted.distortion_coefficients = {-0.2, 0.05};
  cv::Mat mask(96, 320, CV_8UC1, cv::Scalar(255));
  mask.rowRange(80, 96).setTo(0);
  const FrameView view = FrameView::create(distorted).value();
  Odometry of_raw = Odometry::create(distorted, {}, mask).value();
  Odometry of_view = Odometry::create(view.camera(), {}, view.apply_to_mask(mask)).value();
  for (int i = 0; i < 3; ++i) {
    const FrameResult raw = of_raw.process(image_at(i), PixelOrder::kRgb, i).value();
    const FrameResult seen = of_view.process(view.apply(image_at(i)), PixelOrder::kRgb, i).value();
    EXPECT_EQ(raw.world_from_camera.matrix(), seen.world_from_camera.matrix());
    EXPECT_EQ(raw.num_matches, seen.num_matches);
    EXPECT_EQ(raw.camera.matrix(), view.camera().matrix());
    EXPECT_EQ(raw.camera.distortion, Distortion::kNone);
  }
  ASSERT_GT(of_raw.tracked_points().size(), 20U);
  distorted.distortion_coefficients = {50.0};
  EXPECT_THAT(error_of({}, distorted), HasSubstr("camera: expected distortion coefficients"));
  distorted.distortion_coefficients = {std::numeric_limits<double>::quiet_NaN()};
  EXPECT_THAT(error_of({}, distorted), HasSubstr("camera: expected finite distortion"));
  distorted.distortion = Distortion::kNone;
  distorted.distortion_coefficients = {-0.2};
  EXPECT_THAT(error_of({}, distorted), HasSubstr("0 beyond the 0 of its model, found [-0.2"));
  distorted.distortion = Distortion::kEquidistant;
  distorted.distortion_coefficients = {0.0, 0.0, 0.0, 0.0, 0.1};
  EXPECT_THAT(error_of({}, distorted), HasSubstr("0 beyond the 4 of its model"));
}

TEST(OdometryCreate, MetresAreClaimedOnlyWithAHeight) {
  EXPECT_EQ(Options().scale.source, ScaleSource::kNone);
  const Options driving = Options::driving(1.2);
  EXPECT_EQ(driving.scale.source, ScaleSource::kCameraHeight);
  EXPECT_EQ(driving.scale.camera_height_m, 1.2);
  EXPECT_THAT(error_of(Options::driving(-1.0)), HasSubstr("scale.camera_height_m: expected"));
  Options options;
  options.threads = -1;
  EXPECT_THAT(error_of(options), HasSubstr("threads: expected a whole number from 0 to 1024"));
}

TEST(OdometryCreate, ACameraThatIsNoneIsAnError) {
  constexpr double kInf = std::numeric_limits<double>::infinity();
  const std::pair<Camera, const char*> faults[] = {
      {{std::nan(""), 200, 159.5, 47.5, 320, 96}, "camera: expected focal lengths above 0"},
      {{200, 200, 159.5, 47.5, 0, 96}, "found 0x96"},
      {{200, 200, 159.5, kInf, 320, 96}, "principal point"},
      {{0.6, 0.6, 159.5, 47.5, 320, 96}, "relative to the image's size"},
      {{400, 400, 319.5, 95.5, 320, 96}, "a calibration of images about 2 times as large?"}};
  for (const auto& [camera, complaint] : faults) {
    EXPECT_THAT(error_of({}, camera), HasSubstr(complaint));
  }
}

TEST(OdometryCreate, ACentreFarFromTheMiddleIsToldToTheLog) {
  Camera camera = kCamera;
  camera.cy_px = 70;
  Odometry odometry = Odometry::create(camera).value();
  std::string told;
  odometry.set_log([&](LogLevel, const std::string& line) { told += line; });
  EXPECT_THAT(told, HasSubstr("far from the middle"));
}

TEST(OdometryCreate, AModelThatCannotTakeTheFramesIsAnErrorBeforeWork) {
  Options options;
  options.stem.model = tiny_model("fixed_k4s4");  // takes frames of 48x32 only
  options.stem.sampling_px = 4;
  EXPECT_THAT(error_of(options, kitti_camera()),
              AllOf(HasSubstr("fixed_k4s4.onnx"), HasSubstr("found 1241x376")));
}

TEST(OdometryCreate, AFrameSmallerThanTheKernelIsAnError) {
  Options options;
  options.stem.tracking_resolution = TrackingResolution::kHalf;
  EXPECT_THAT(error_of(options, {200, 200, 0.5, 0.5, 1, 1}), HasSubstr("found 1x1"));
}

TEST(OdometryProcess, AnImageOfAnotherSizeOrTypeIsAnErrorAndChangesNothing) {
  Odometry odometry = Odometry::create(kCamera).value();
  const auto message = [&](const cv::Mat& image, PixelOrder order) {
    return message_of(odometry.process(image, order, 1.0));
  };
  EXPECT_THAT(message(cv::Mat3b(95, 320), PixelOrder::kRgb),
              AllOf(HasSubstr("expected 320x96"), HasSubstr("found 320x95")));
  EXPECT_THAT(message(cv::Mat(), PixelOrder::kGray), HasSubstr("found 0x0"));
  EXPECT_THAT(message(cv::Mat1b(96, 320), PixelOrder::kBgr), HasSubstr("pixels of CV_8UC3, found"));
  EXPECT_THAT(message(cv::Mat3b(96, 320), PixelOrder::kGray),
              HasSubstr("pixels of CV_8UC1, found"));
  EXPECT_THAT(message(cv::Mat1w(96, 320), PixelOrder::kGray), HasSubstr("CV_16U"));
  EXPECT_EQ(odometry.process(image_at(0), PixelOrder::kRgb, 1.0)->state, FrameState::kFirst);
}

TEST(OdometryProcess, ATimeThatDoesNotRiseIsAnErrorThatNamesBothAndChangesNothing) {
  Odometry odometry = Odometry::create(kCamera).value();
  const auto message = [&](double time_s) {
    const auto result = odometry.process(image_at(0), PixelOrder::kRgb, time_s);
    return result ? std::string(to_string(result->state)) : result.error().message;
  };
  EXPECT_THAT(message(std::nan("")), HasSubstr("time: expected a finite number"));
  EXPECT_EQ(message(-2.5), "first");
  EXPECT_THAT(message(-2.5), AllOf(HasSubstr("after the last frame's, -2.5 s"), HasSubstr("-2.5")));
  EXPECT_THAT(message(-3.0), AllOf(HasSubstr("-2.5 s"), HasSubstr("found -3 s")));
  EXPECT_THAT(message(std::numeric_limits<double>::infinity()), HasSubstr("found inf"));
  EXPECT_THAT(message(1.7e18), HasSubstr("up to 1e+11")) << "nanoseconds since 1970";
  EXPECT_EQ(message(-2.4), "stationary");
  EXPECT_EQ(odometry.process(image_at(0), PixelOrder::kRgb, 9.0)->time_s, 9.0);
}

TEST(OdometryProcess, HintsThatDoNotFitAreErrorsAndChangeNothing) {
  Odometry odometry = Odometry::create(kCamera).value();
  const auto message = [&](const FrameHints& hints) {
    return message_of(odometry.process(image_at(0), PixelOrder::kRgb, 1.0, hints));
  };
  EXPECT_THAT(message({.mask = cv::Mat(96, 319, CV_8UC1)}), HasSubstr("mask: expected 320x96"));
  EXPECT_THAT(message({.prev_from_cur = Eigen::Quaterniond(0.9, 0.0, 0.0, 0.0)}),
              HasSubstr("prev_from_cur: expected a quaternion of length 1, found one of 0.9"));
  EXPECT_THAT(message({.prev_from_cur = Eigen::Quaterniond(std::nan(""), 0.0, 0.0, 0.0)}),
              HasSubstr("prev_from_cur"));
  EXPECT_EQ(message({.prev_from_cur = Eigen::Quaterniond::Identity()}), "no error");
}

TEST(OdometryProcess, TinyImagesAreTrackedOrNotButNothingThrows) {
  for (const cv::Size size : {cv::Size(4, 4), {5, 9}, {12, 12}, {40, 6}, {7, 300}}) {
    for (const FeatureMethod method :
         {FeatureMethod::kPatch, FeatureMethod::kKlt, FeatureMethod::kOrb, FeatureMethod::kSift}) {
      Camera camera{50, 50, size.width / 2.0, size.height / 2.0, size.width, size.height};
      Options options;
      options.features.method = method;
      auto odometry = Odometry::create(camera, options);
      for (int i = 0; i < 3; ++i) {
        const cv::Mat image = image_at(i)(cv::Rect(0, 0, std::min(size.width, 320), 4));
        cv::Mat tiny;
        cv::resize(image, tiny, size);
        EXPECT_TRUE(odometry->process(tiny, PixelOrder::kRgb, i)) << size;
      }
    }
  }
}

TEST(OdometryProcess, BgrGivesTheChannelThatRgbGives) {
  Odometry of_rgb = Odometry::create(kCamera).value();
  Odometry of_bgr = Odometry::create(kCamera).value();
  Odometry mistaken = Odometry::create(kCamera).value();
  for (int i = 0; i < 3; ++i) {
    const cv::Mat rgb = image_at(i);
    cv::Mat bgr;
    cv::cvtColor(rgb, bgr, cv::COLOR_RGB2BGR);
    ASSERT_TRUE(of_rgb.process(rgb, PixelOrder::kRgb, i));
    ASSERT_TRUE(of_bgr.process(bgr, PixelOrder::kBgr, i));
    ASSERT_TRUE(mistaken.process(bgr, PixelOrder::kRgb, i));
    EXPECT_EQ(rgb.at<cv::Vec3b>(5, 5)[0], bgr.at<cv::Vec3b>(5, 5)[2]);  // neither is written to
    EXPECT_EQ(cv::norm(of_rgb.channel_image(), of_bgr.channel_image(), cv::NORM_INF), 0.0);
    EXPECT_GT(cv::norm(of_rgb.channel_image(), mistaken.channel_image(), cv::NORM_INF), 0.0);
  }
  EXPECT_GT(of_rgb.tracked_points().size(), 20U);
}

}  // namespace
}  // namespace stemvo
