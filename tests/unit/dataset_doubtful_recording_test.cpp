// SPDX-License-Identifier: MIT
// Recordings whose names, times, sizes or values would give a wrong path: refused, read right, or
// said.
#include "odometry/check_frame.hpp"
#include "support/test.hpp"
#include "support/written_images.hpp"

namespace stemvo {
namespace {

class DoubtfulRecording : public WrittenImages {};

TEST_F(DoubtfulRecording, FramesThatAreMissingByTheirNumbersTakeTheirTime) {
  const auto near = [](double s) { return ::testing::DoubleNear(s, 1e-9); };
  FrameSourceRequest dropped = write_images({"f_000010.png", "f_000011.png", "f_000015.png"});
  EXPECT_THAT(open_source(dropped)->timestamps_s, ElementsAre(0.0, near(0.1), near(0.5)));
  EXPECT_THAT(open_source(dropped)->warnings,
              ElementsAre(HasSubstr("15.png: missing up to it: 3 numbers")));
  dropped.frames = FrameRangeRequest{1, std::nullopt};
  EXPECT_THAT(open_source(dropped)->timestamps_s, ElementsAre(near(0.1), near(0.5)));
  dropped.frames.reset();
  dropped.times = temp_.file("times.txt", "0\n0.1\n0.2\n");
  EXPECT_THAT(open_source(dropped)->warnings, IsEmpty()) << "times are told";
  const auto every_tenth = open_source(write_images({"0.png", "10.png", "20.png", "40.png"}));
  EXPECT_THAT(every_tenth->timestamps_s, ElementsAre(0.0, near(0.1), near(0.2), near(0.4)));
  EXPECT_THAT(every_tenth->warnings, ElementsAre(HasSubstr("missing up to it: 1")));
}

TEST_F(DoubtfulRecording, NumbersThatCountNoFramesAreCountedEvenly) {
  for (const auto& names : std::vector<std::vector<std::string>>{
           {"1700000000033.png", "1700000000066.png", "1700000000100.png"},
           {"12-30-58.png", "12-30-59.png", "12-31-00.png"},
           {"20240101_120058.png", "20240101_120059.png", "20240101_120100.png"},
           {"5.1.png", "5.2.png", "5.4.png"},
           {"1.png", "8.png", "30.png", "31.png"}}) {
    const FrameSource source = open_source(write_images(names)).value();
    EXPECT_NEAR(source.timestamps_s[2], 0.2, 1e-9) << names[0];
    EXPECT_THAT(source.warnings, IsEmpty());
  }
}

TEST_F(DoubtfulRecording, SixteenBitsAreStretchedByAllOfTheRecording) {
  FrameSourceRequest request = write_images({});
  for (int i = 0; i < 40; ++i) {  // out of a dark garage
    cv::Mat image(24, 32, CV_16UC1);
    cv::randu(image, 0, i < 10 ? 200 : 4000);
    cv::imwrite((request.sequence_dir / fmt::format("{}.png", i)).string(), image);
  }
  const auto source = open_source(request);
  cv::Mat counts = source->read(35).value() == 255;
  EXPECT_LT(cv::countNonZero(counts), 24 * 32 / 50) << "saturated";
  EXPECT_THAT(source->warnings, ElementsAre(HasSubstr("images of 16 bits: values from 0 to 4095")));
}

TEST_F(DoubtfulRecording, ACentreOfImagesALittleLargerIsSaid) {
  Camera camera{718.9, 718.9, 607.2, 185.2, 1241, 376};
  EXPECT_EQ(doubt_of(camera), "");
  for (const double scale : {1.1, 1.15, 1.0 / 1.15}) {
    camera.width_px = cvRound(scale * 1241);
    camera.height_px = cvRound(scale * 376);
    EXPECT_THAT(doubt_of(camera), HasSubstr(scale > 1.0 ? "images about 0.8" : "about 1.1 times"));
  }
}

TEST_F(DoubtfulRecording, NumbersOfFramesBesideTheTruthsTimesAreNamed) {
  FrameSourceRequest request = write_images({"1.png", "2.png", "3.png", "4.png"});
  const auto error_with = [&](double first_s, double step_s, int count, const char* times) {
    std::string poses;
    for (int i = 0; i < count; ++i) {
      poses += fmt::format("{:.4f} 0 0 {} 0 0 0 1\n", first_s + step_s * i, i);
    }
    request.ground_truth = temp_.file("truth.txt", poses);
    request.times = temp_.file("times.txt", times);
    return message_of(open_source(request));
  };
  constexpr const char* kNumbers = "0\n1\n2\n3\n";
  constexpr const char* kSeconds = "0\n0.1\n0.2\n0.3\n";
  EXPECT_THAT(error_with(0.0, 1.0, 4, kSeconds),
              HasSubstr("truth.txt: expected steps as frames', 0.1 s, found 1: numbers"));
  EXPECT_THAT(error_with(1305031102.0, 0.1, 9, kNumbers), HasSubstr("1 s, found 0.1: "));
  EXPECT_THAT(error_with(0.0, 0.1, 4, kNumbers), HasSubstr("numbers of frames?"));
  EXPECT_EQ(error_with(0.0, 0.1, 4, kSeconds), "no error");
  EXPECT_EQ(error_with(0.0, 1.0, 4, kNumbers), "no error");
  EXPECT_EQ(error_with(0.0, 0.1, 31, kNumbers), "no error") << "a frame a second";
  EXPECT_THAT(error_with(1305031102.0, 0.1, 9, kSeconds), HasSubstr("poses are of 1305031102.000"));
}

}  // namespace
}  // namespace stemvo
