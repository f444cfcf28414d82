// SPDX-License-Identifier: MIT
// Inputs that are sound by themselves and would give a wrong path: refused, read right, or said.
#include "evaluation/trajectory.hpp"
#include "support/test.hpp"
#include "support/written_images.hpp"
#include "text/text_file.hpp"

namespace stemvo {
namespace {

using dataset::read_camera_file;

constexpr const char* kOfRos =
    "width: 640\nheight: 480\ndistortion_model: plumb_bob\nd: [0.2, -0.7, 0, 0.001, 0.9]\n"
    "k: [520, 0, 325.5, 0, 521, 249.5, 0, 0, 1]\n";

class DoubtfulInput : public WrittenImages {
 protected:
  std::string error_of_camera(const std::string& text) const {
    return message_of(read_camera_file(temp_.file("camera.yaml", text)));
  }
  static std::string error_of(const FrameSourceRequest& request) {
    return message_of(open_source(request));
  }
};

TEST_F(DoubtfulInput, CamerasOfOtherImages) {
  const auto camera = [](const std::string& size, const std::string& numbers) {
    return "resolution: " + size + "\nintrinsics: [" + numbers + "]\ndistortion_model: none\n";
  };
  const std::string kitti = "721.5, 721.5, 609.6, 172.9";
  EXPECT_EQ(error_of_camera(camera("[1242, 375]", kitti)), "no error");
  EXPECT_THAT(error_of_camera(camera("[416, 128]", kitti)),
              AllOf(HasSubstr("camera.yaml:2: intrinsics: expected a principal point inside"),
                    HasSubstr("about 2.8 times as large")));
  EXPECT_THAT(error_of_camera(camera("[640, 192]", kitti)), HasSubstr("near the middle"));
  EXPECT_THAT(error_of_camera(camera("[2484, 750]", kitti)), HasSubstr("0.48 times as large"));
  EXPECT_THAT(error_of_camera(camera("[640, 192]", "0.58, 1.92, 0.5, 0.5")),
              HasSubstr("relative to the image's size"));
  EXPECT_EQ(error_of_camera(camera("[640, 192]", "9000, 9000, 320, 96")), "no error");
  EXPECT_THAT(error_of_camera(camera("[640, 192]", "20, 20, 320, 96")),
              HasSubstr("expected a field of view of at most 170 degrees, found 172.8"));
}

TEST_F(DoubtfulInput, ACentreFarFromTheMiddleIsSaid) {
  FrameSourceRequest request = write_images({"1.png", "2.png"});
  EXPECT_THAT(open_source(request)->warnings, IsEmpty());
  for (const auto& [intrinsics, words] :
       {std::pair("30, 31, 15.5, 7", "(15.5, 7.0) is far from the middle"),
        {"20, 30, 15.5, 11.5", "20.0 and 30.0 pixels"},
        {"300, 300, 15.5, 11.5", "a field of view of 6.1 degrees is small"},
        {"6, 6, 15.5, 11.5", "degrees is large"}}) {
    request.camera_file = write_camera(intrinsics);
    EXPECT_THAT(open_source(request)->warnings, ElementsAre(HasSubstr(words)));
  }
}

TEST_F(DoubtfulInput, PartsOfImagesAndSkewAreRefusedByName) {
  const std::string good = kOfRos;
  const std::string zeros =
      "binning_x: 0\nbinning_y: 1\nroi: {x_offset: 0, y_offset: 0, height: 0, width: 640}\n";
  EXPECT_EQ(error_of_camera(good + zeros), "no error");
  EXPECT_THAT(error_of_camera(good + "binning_x: 2\n"), HasSubstr("binning_x: expected 0 or 1"));
  EXPECT_THAT(error_of_camera(good + "roi: {x_offset: 8, y_offset: 0, height: 0, width: 0}\n"),
              HasSubstr("roi: expected the whole image"));
  EXPECT_EQ(error_of_camera(good + "roi: [0, 0, 640, 480]\n"), "no error");
  EXPECT_THAT(error_of_camera(good + "roi: [8, 0, 640, 480]\n"), HasSubstr(":6: roi: expected"));
  EXPECT_THAT(error_of_camera(good + "roi: 8\n"), HasSubstr("roi: expected the whole image"));
  EXPECT_THAT(error_of_camera(replace_first(good, "520, 0", "520, 3")),
              HasSubstr("without skew, found [520, 3, "));
}

TEST_F(DoubtfulInput, TheCameraOfRectifiedImagesIsSaid) {
  const auto warnings_of = [&](const std::string& more) {
    return read_camera_file(temp_.file("info.yaml", kOfRos + more)).value().warnings;
  };
  EXPECT_THAT(warnings_of(""), IsEmpty());
  EXPECT_THAT(warnings_of("p: [520, 0, 325.5, 0, 0, 521, 249.5, 0, 0, 0, 1, 0]\n"), IsEmpty());
  EXPECT_THAT(warnings_of("p: [480, 0, 330, 0, 0, 500, 251, 0, 0, 0, 1, 0]\n"),
              ElementsAre(HasSubstr("rectified have intrinsics [480, 500, 330, 251], of p")));
}

TEST_F(DoubtfulInput, NoLensInEveryForm) {
  for (const char* lens : {"distortion_model: ''\nd: []\n", "distortion_model: plumb_bob\nd: []\n",
                           "distortion_model: plumb_bob\nd: [0, 0, 0, 0, 0]\n",
                           "distortion_model: none\nd: [0, 0, 0, 0]\n",
                           "distortion_model: ''\nd: [0.0, 0.0, 0.0, 0.0, 0.0]\n"}) {
    const std::string size =
        "width: 640\nheight: 480\nk: [520, 0, 325.5, 0, 521, 249.5, 0, 0, 1]\n";
    const auto camera = read_camera_file(temp_.file("none.yaml", size + lens));
    EXPECT_EQ(camera->camera.distortion_coefficients[0], 0.0);
  }
}

TEST_F(DoubtfulInput, TheRationalModelIsTakenAndWritten) {
  const std::string text = replace_first(replace_first(kOfRos, "plumb_bob", "rational_polynomial"),
                                         "0.9]", "0.9, 0.1, 0.2, 0.3]");
  const auto camera = read_camera_file(temp_.file("rational.yaml", text));
  EXPECT_EQ(camera->camera.distortion_coefficients,
            (std::array<double, 12>{0.2, -0.7, 0, 0.001, 0.9, 0.1, 0.2, 0.3}));
  const auto again = read_camera_file(temp_.file("ours.yaml", camera_file_text(*camera)));
  EXPECT_EQ(again->camera.distortion_coefficients, camera->camera.distortion_coefficients);
  EXPECT_THAT(error_of_camera(replace_first(text, "0.3]", "0.3, 0, 0, 0, 0, 0.01, 0]")),
              HasSubstr("found 14 numbers"));
}

TEST_F(DoubtfulInput, CamerasOfColmap) {
  const auto read = [&](const std::string& row) {
    return read_camera_file(temp_.file("cameras.txt", "# Camera list\n#   CAMERA_ID, ..\n" + row));
  };
  const auto radial = read("7 SIMPLE_RADIAL 640 480 520 320 240 0.1\n");
  EXPECT_EQ(radial->camera.fy_px, 520.0);
  EXPECT_EQ(radial->camera.cy_px, 239.5) << "the first pixel's centre is (0.5, 0.5) there";
  EXPECT_THAT(read("1 FOV 640 480 520 520 320 240 0.9\n").error().message, HasSubstr(":3: "));
  EXPECT_THAT(read("1 PINHOLE 640 480 520 320 240\n").error().message,
              HasSubstr("expected 6 numbers, found 5"));
  const std::string two = "1 PINHOLE 640 480 520 520 320 240\n2 PINHOLE 640 480 520 520 320 240\n";
  EXPECT_THAT(read(two).error().message, HasSubstr("expected one camera, found 2"));
  EXPECT_THAT(read("").error().message, HasSubstr("expected one camera, found 0"));
}

TEST_F(DoubtfulInput, FramesThatAreThereTwiceAreRefused) {
  const FrameSourceRequest same = write_images({"f1.png", "f2.png", "f2.jpg"});
  EXPECT_THAT(error_of(same), AllOf(HasSubstr("f2."), HasSubstr("/f*.jpg'")));
  FrameSourceRequest stereo = write_images({"left_01.png", "left_02.png", "right_1.png"});
  EXPECT_THAT(error_of(stereo), AllOf(HasSubstr("left_01.png"), HasSubstr("right_1.png")));
  stereo.sequence_dir /= "left_*.png";
  EXPECT_EQ(error_of(stereo), "no error");
  stereo.sequence_dir = temp_ / "drive/*.png";
  EXPECT_THAT(open_source(stereo)->warnings, ElementsAre(HasSubstr("right_1.png")));
  EXPECT_EQ(error_of(write_images({"day1_1.png", "day1_2.png", "day2_1.png", "start.png"})),
            "no error");
  FrameSourceRequest numbered =
      write_images({"cam1_01.png", "cam1_02.png", "cam2_1.png", "cam2_2.png"});
  EXPECT_THAT(error_of(numbered), AllOf(HasSubstr("cam2_1.png"), HasSubstr("drive/cam1_*.png'")));
  numbered.sequence_dir /= "cam1_*.png";
  EXPECT_EQ(open_source(numbered)->files.size(), 2U);
  for (const char* format : {"{}.{}.png", "s{}_{}.png"}) {
    std::vector<std::string> seconds;
    for (int i = 0; i < 6; ++i) {
      seconds.push_back(fmt::format(fmt::runtime(format), i / 2, i % 2));
    }
    EXPECT_EQ(error_of(write_images(seconds)), "no error") << format;
  }
  // Whole minutes, and as many frames of cameras whose numbers look like that.
  for (const auto& [step, count] : {std::pair(1.0, 60), std::pair(0.5, 120), std::pair(2.0, 30)}) {
    for (const char* format :
         {"12-30-{:04.1f}.png", "day_2330-{:04.1f}.png", "cam2_{:04.1f}.png"}) {
      std::vector<std::string> names;
      for (int i = 0; i < 2 * count; ++i) {
        std::string name = fmt::format(fmt::runtime(format), step * (i % count));
        names.push_back(i < count ? name : name.replace(name.find_first_of("02"), 1, "1"));
      }
      EXPECT_EQ(error_of(write_images(names)) == "no error", *format != 'c') << names.back();
    }
  }
  EXPECT_THAT(error_of(write_images({"0_00.png", "0_01.png", "1_00.png", "1_01.png"})),
              HasSubstr("1_00.png"));
}

TEST_F(DoubtfulInput, PairsOfCamerasBehindTheNumberAndAMaskAreNoFrames) {
  FrameSourceRequest pairs = write_images(
      {"1_cam0.png", "1_cam1.png", "2_cam0.png", "2_cam1.png", "3_cam0.png", "3_cam1.png"});
  EXPECT_THAT(error_of(pairs), AllOf(HasSubstr("found 1_cam1.png"), HasSubstr("*_cam0.png'")));
  pairs.sequence_dir /= "*_cam0.png";
  EXPECT_EQ(open_source(pairs)->files.size(), 3U);
  const auto masked = open_source(write_images({"1.png", "2.png", "3.png", "mask.png"}));
  EXPECT_THAT(masked->warnings, ElementsAre(HasSubstr("mask.png: has no number")));
  EXPECT_THAT(
      error_of(write_images({"left1700000013.png", "left1700000023.png", "left1700000033.png",
                             "right1700000014.png", "right1700000024.png", "right1700000034.png"})),
      AllOf(HasSubstr("right1700000014.png"), HasSubstr("/left*.png'")));
  for (const auto& two_cameras : std::vector<std::vector<std::string>>{
           {"01_0.png", "01_1.png", "02_0.png", "02_1.png", "03_0.png", "03_1.png", "04_0.png",
            "04_1.png", "05_0.png", "05_1.png"},
           {"cam10_7.png", "cam10_8.png", "cam11_7.png", "cam11_8.png"},
           {"l_17.png", "l_27.png", "l_37.png", "mask.png", "r_18.png", "r_28.png", "r_38.png"},
           {"1-c0.png", "1-c1.png", "2-c0.png", "2-c1.png", "3-c0.png", "3-c1.png"},
           {"cam0_170.png", "cam0_270.png", "cam0_370.png", "cam1_171.png", "cam1_271.png",
            "cam1_371.png"},
           {"170_cam0.png", "171_cam1.png", "270_cam0.png", "271_cam1.png", "370_cam0.png",
            "371_cam1.png"},
           {"00001_left.png", "00004_right.png", "00051_left.png", "00054_right.png",
            "00101_left.png", "00104_right.png"},
           {"a_5.100.png", "b_5.103.png", "a_5.200.png", "b_5.203.png", "a_5.300.png",
            "b_5.303.png"}}) {
    EXPECT_THAT(error_of(write_images(two_cameras)), HasSubstr("a quoted pattern tells which"))
        << two_cameras[0];
  }
  for (const auto& one_camera : std::vector<std::vector<std::string>>{
           {"5.05.png", "5.25.png", "5.3.png", "5.5.png"},
           {"100_000.png", "100_500.png", "101_000.png", "101_500.png"},
           {"1.1.png", "1.9.png", "1.10.png", "1.11.png"},
           {"1700000001_033333333.png", "1700000001_066666666.png", "1700000002_000000000.png",
            "1700000002_033333333.png"},
           {"0.1.png", "0.1333.png", "0.1667.png", "0.2.png", "1.png", "1.0333.png"},
           {"part1_1.png", "part1_2.png", "part1_3.png", "part2_4.png", "part2_5.png",
            "part2_6.png"},
           {"cam0_frame1.png", "cam0_frame2.png", "cam0_frame3.png"},
           {"img (1).png", "img (2).png", "img (3).png"},
           {"12h30m08s1.png", "12h30m08s2.png", "12h30m09s1.png", "12h30m09s2.png",
            "12h30m10s1.png", "12h30m10s2.png"}}) {
    const auto source = open_source(write_images(one_camera));
    EXPECT_TRUE(source && source->warnings.empty()) << one_camera[0] << message_of(source);
    for (std::size_t i = 0; source && i < one_camera.size(); ++i) {
      EXPECT_EQ(source->files[i].filename(), one_camera[i]);
    }
  }
}

TEST_F(DoubtfulInput, NumbersOfFramesAreNoTimes) {
  FrameSourceRequest request = write_images({"1.png", "2.png", "3.png"});
  request.times = temp_.file("times.txt", "0\n1\n2\n");
  EXPECT_THAT(open_source(request)->notes, ElementsAre(HasSubstr("times 0, 1, .. are taken for")));
  request.times = temp_.file("times.txt", "0\n1\n2.5\n");
  EXPECT_THAT(open_source(request)->notes, IsEmpty());
}

TEST_F(DoubtfulInput, AnOrientationByExifIsSaid) {
  const FrameSourceRequest request = write_images({"1.jpg", "2.jpg"});
  const fs::path first = request.sequence_dir / "1.jpg";
  const std::string jpeg = read_text_file(first).value();
  for (const char turn : {'\1', '\3', '\6'}) {
    const std::string little =
        std::string("II*\0\x08\0\0\0\1\0\x12\1\3\0\1\0\0\0", 18) + turn + std::string(7, '\0');
    const std::string exif = std::string(
                                 "\xff\xe1\0\x22"
                                 "Exif\0\0",
                                 10) +
                             little;
    ASSERT_TRUE(write_text_file(first, jpeg.substr(0, 2) + exif + jpeg.substr(2)));
    const auto source = open_source(request);
    EXPECT_EQ(source->warnings.size(), turn == '\1' ? 0U : 1U);
    EXPECT_TRUE(turn == '\1' || source->warnings[0].find(
                                    fmt::format("orientation {}", int{turn})) != std::string::npos);
  }
}

TEST_F(DoubtfulInput, TimesInOtherUnits) {
  FrameSourceRequest request = write_images({"1.png", "2.png", "3.png"});
  for (const auto& [unit, name] :
       std::vector<std::pair<const char*, const char*>>{{"", ""},
                                                        {"000", "milliseconds"},
                                                        {"000000", "microseconds"},
                                                        {"000000000", "nanoseconds"}}) {
    request.times =
        temp_.file("times.txt", fmt::format("1700000000{0}\n1700000001{0}\n1700000002{0}\n", unit));
    const auto source = open_source(request);
    EXPECT_NEAR(source->timestamps_s[2] - source->timestamps_s[1], 1.0, 1e-6) << name;
    EXPECT_NEAR(source->timestamps_s[0], 1.7e9, 1e-3) << name;
    EXPECT_EQ(source->notes.size(), *name == '\0' ? 0U : 1U);
    EXPECT_TRUE(source->notes.empty() || source->notes[0].find(name) != std::string::npos) << name;
  }
}

TEST_F(DoubtfulInput, TimesOfFastCamerasAndOfEurocsLayout) {
  FrameSourceRequest request = write_images({"1.png", "2.png", "3.png"});
  request.times = temp_.file("times.txt", "1317000000\n1317000005\n1317000010\n");
  EXPECT_THAT(error_of(request), HasSubstr("found steps of 5, seconds or milliseconds"));
  const auto open = [&](const std::string& first, const std::string& rest) {
    request.times = temp_.file("times.txt", first + "0000\n" + first + rest);
    return open_source(request);
  };
  for (const char* rest : {"2000\n", "1000\n"}) {
    const std::string again = std::string(rest).substr(0, 1) + "500\n";
    EXPECT_THAT(message_of(open("0", rest + ("0" + again))),
                HasSubstr("expected times in seconds, found steps of"));
    EXPECT_NEAR(open("170000000000", rest + ("170000000000" + again))->timestamps_s[0], 1.7e9, 1.0);
  }
  fs::create_directories(temp_ / "drive/data");
  fs::copy(temp_ / "drive/1.png", temp_ / "drive/data/1.png");
  fs::copy(temp_ / "drive/1.png", temp_ / "drive/data/2.png");
  fs::copy(*request.camera_file, temp_ / "drive/sensor.yaml");
  (void)temp_.file("drive/data.csv",
                   "#timestamp,filename\n1403715273.25,1.png\n1403715273.3,2.png\n");
  request.times.reset();
  const auto euroc = open_source(request);
  EXPECT_THAT(euroc->timestamps_s, ElementsAre(1403715273.25, 1403715273.3));
  EXPECT_THAT(euroc->notes, ElementsAre(HasSubstr("data.csv: times are taken for seconds")));
}

TEST_F(DoubtfulInput, SixteenBitsAreStretchedByWhatIsUsed) {
  const auto read = [&](int from, int to) {
    cv::Mat image(24, 32, CV_16UC1);
    for (int i = 0; i < 24 * 32; ++i) {
      image.at<std::uint16_t>(i / 32, i % 32) =
          static_cast<std::uint16_t>(from + (to - from) * i / (24 * 32 - 1));
    }
    const auto source = open_source(write_images({"1.png", "2.png"}, image));
    double low = 0.0;
    double high = 0.0;
    cv::minMaxLoc(source->read(1).value(), &low, &high);
    return std::vector<double>{low, high, static_cast<double>(source->warnings.size())};
  };
  EXPECT_THAT(read(0, 65535), ElementsAre(0, 255, 0));
  EXPECT_THAT(read(0, 1023), ElementsAre(0, 255, 1)) << "10 bits";
  EXPECT_THAT(read(0, 3500), ElementsAre(0, 218, 1)) << "12 bits";
  EXPECT_THAT(read(0, 200), ElementsAre(0, 200, 1)) << "8 bits stay what they are";
  EXPECT_THAT(read(8000, 9000), ElementsAre(64, 191, 1)) << "thermal: half more to both sides";
}

/// Frames without pictures' contents; times and turn as told.
dataset::VideoDecoder told_decoder(const std::vector<double>& times_ms, int turned_deg) {
  const auto next = std::make_shared<std::size_t>(0);
  return {.size = {32, 24},
          .rate_hz = 10.0,
          .turned_deg = turned_deg,
          .grab = [=] { return ++*next <= times_ms.size(); },
          .retrieve = [] { return cv::Mat(24, 32, CV_8UC3, cv::Scalar::all(90)); },
          .position_ms = [=] { return times_ms.at(*next - 1); }};
}

class DoubtfulVideo : public DoubtfulInput {
 protected:
  Expected<FrameSource> open(const std::vector<double>& times_ms, int turned_deg) const {
    FrameSourceRequest request = write_images({});
    request.sequence_dir = "drive.mp4";
    const auto stream = std::make_shared<dataset::VideoStream>(told_decoder(times_ms, turned_deg),
                                                               "drive.mp4", false);
    return dataset::open_stream(stream, *read_camera_file(*request.camera_file), request);
  }
};

TEST_F(DoubtfulVideo, FramesWithoutTimesAreCounted) {
  const auto times_of = [&](const std::vector<double>& told_ms) {
    const auto source = open(told_ms, 0).value();
    std::vector<double> times_s;
    for (std::size_t i = 0; i < told_ms.size(); ++i) {
      EXPECT_TRUE(source.read(i));
      times_s.push_back(source.time_s(i));
    }
    const std::size_t num_counted = source.stream->num_counted();
    EXPECT_EQ(source.remarks().size(), num_counted > 0 ? 1U : 0U) << "calibrate and channel say it";
    times_s.push_back(static_cast<double>(num_counted));
    return times_s;
  };
  const double none = -7.7e15;  // FFmpeg's least number in ms
  EXPECT_THAT(times_of({none, none, none}), ElementsAre(0.0, 0.1, 0.2, 3.0)) << "camera file's";
  EXPECT_THAT(times_of({5000, 5250, 5500}), ElementsAre(5.0, 5.25, 5.5, 0.0)) << "late, no shift";
  EXPECT_THAT(times_of({5000, 5250, 5500, none, 5500}), ElementsAre(5.0, 5.25, 5.5, 5.75, 6.0, 0.0))
      << "kept back until the end";
  EXPECT_THAT(times_of({5000, 5250, none, 5750}), ElementsAre(5.0, 5.25, 5.5, 5.75, 1.0));
}

TEST_F(DoubtfulVideo, ATurnIsSaid) {
  EXPECT_THAT(open({0.0}, 0)->warnings, IsEmpty());
  EXPECT_THAT(open({0.0}, 180)->warnings, ElementsAre(HasSubstr("turned by 180 degrees")));
}

}  // namespace
}  // namespace stemvo
