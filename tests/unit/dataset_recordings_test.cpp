// SPDX-License-Identifier: MIT
#include "dataset/frame_files.hpp"
#include "dataset/frame_source.hpp"
#include "support/run_program.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

constexpr int kNumFrames = 6;
constexpr int kWidth_px = 64;
constexpr int kHeight_px = 48;
constexpr const char* kIntrinsics =
    "resolution: [64, 48]\nintrinsics: [60, 61, 31.5, 23.5]\ndistortion_model: none\n";

/// Frame i is gray of 20 + 40 i, so that it is known again.
cv::Mat frame(int index) {
  return {kHeight_px, kWidth_px, CV_8UC3, cv::Scalar::all(20 + 40 * index)};
}

/// Recordings in the layouts of others, written anew for each test.
class Recordings : public ::testing::Test {
 protected:
  FrameSourceRequest request(const std::string& input) const {
    FrameSourceRequest result;
    result.sequence_dir = input;
    return result;
  }
  FrameSourceRequest with_camera(const std::string& input) const {
    FrameSourceRequest result = request(input);
    result.camera_file = camera("");
    return result;
  }
  static std::string error_of(const FrameSourceRequest& request) {
    return message_of(open_source(request));
  }
  /// As frame() made it, but for what a lossy video changes.
  static void expect_frame(const Expected<cv::Mat>& image, int index) {
    ASSERT_FALSE(image->empty()) << index;
    EXPECT_NEAR(cv::mean(*image)[0], 20 + 40 * index, 4.0);
  }
  std::string camera(const std::string& more = "rate_hz: 10\n") const {
    return temp_.file("camera.yaml", kIntrinsics + more);
  }

  /// cam0 at 20 Hz from 1403636579.763555584 s on; true poses at 200 Hz from frame 1 to frame 4.
  fs::path write_euroc() const {
    const fs::path mav = temp_ / "MH_00/mav0";
    fs::create_directories(mav / "cam0/data");
    fs::create_directories(mav / "state_groundtruth_estimate0");
    constexpr long kFirst_ns = 1403636579763555584;
    constexpr long kFrame_ns = 50000000;
    std::string list = "#timestamp [ns],filename\r\n";
    for (int i = 0; i < kNumFrames; ++i) {
      const std::string name = fmt::format("{}.png", kFirst_ns + i * kFrame_ns);
      list += fmt::format("{},{}\r\n", kFirst_ns + i * kFrame_ns, name);
      cv::imwrite((mav / "cam0/data" / name).string(), frame(i));
    }
    std::string truth = "#timestamp, p_RS_R_x [m], q_RS_w [], q_RS_x [], ..\n";
    for (int k = 10; k <= 40; ++k) {  // the body moves along its x by 1 m per frame
      truth += fmt::format("{},{},0,0,1,0,0,0,0,0,0,0,0,0,0,0,0\n",
                           kFirst_ns + k * kFrame_ns / 10 + 1000000, 0.1 * k);
    }
    (void)temp_.file("MH_00/mav0/cam0/data.csv", list);
    (void)temp_.file("MH_00/mav0/cam0/sensor.yaml",  // the camera looks along the body's x
                     "sensor_type: camera\nrate_hz: 20\n" + std::string(kIntrinsics) +
                         "T_BS:\n  cols: 4\n  rows: 4\n"
                         "  data: [0, 0, 1, 0, -1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 0, 1]\n");
    (void)temp_.file("MH_00/mav0/state_groundtruth_estimate0/data.csv", truth);
    return temp_ / "MH_00";
  }

  fs::path write_tum() const {
    fs::create_directories(temp_ / "desk/rgb");
    std::string list = "# color images\n# timestamp filename\n";
    std::string truth = "# timestamp tx ty tz qx qy qz qw\n";
    for (int i = 0; i < kNumFrames; ++i) {
      const double time_s = 1305031452.791720 + i / 30.0;
      const std::string name = fmt::format("rgb/{:.6f}.png", time_s);
      list += fmt::format("{:.6f} {}\n", time_s, name);
      truth += fmt::format("{:.4f} 0 0 {} 0 0 0 1\n", time_s + (i == 2 ? 0.015 : 0.004), i);
      cv::imwrite((temp_ / "desk" / name).string(), frame(i));
    }
    (void)temp_.file("desk/rgb.txt", list);
    (void)temp_.file("desk/groundtruth.txt", truth);
    return temp_ / "desk";
  }

  std::string write_video(double rate_hz = 25.0) const {
    const std::string file = temp_ / "drive.avi";
    std::vector<fs::path> images;
    for (int i = 0; i < kNumFrames; ++i) {
      images.push_back(temp_ / fmt::format("video_{}.png", i));
      cv::imwrite(images.back().string(), frame(i));
    }
    test::write_video(file, rate_hz, images);
    return file;
  }

  TempFolder temp_;
};

TEST_F(Recordings, EurocTruthIsTheCamerasAndOfFramesThatHaveSome) {
  const auto source = open_source(request(write_euroc()));
  const auto truth = source->ground_truth_of(6).value();
  ASSERT_TRUE(truth);
  EXPECT_THAT(truth->frames, ElementsAre(1, 2, 3, 4));
  for (std::size_t i = 0; i < 4; ++i) {  // along the camera's z, which is the body's x
    EXPECT_TRUE(truth->poses[i].translation.isApprox(
        Eigen::Vector3d(0.0, 0.0, static_cast<double>(i)), 1e-9))
        << truth->poses[i].translation.transpose();
  }
  const auto interrupted = source->ground_truth_of(3);
  EXPECT_THAT((*interrupted)->frames, ElementsAre(1, 2));
}

TEST_F(Recordings, TumWithinTheTolerance) {
  FrameSourceRequest tum = request(write_tum());
  EXPECT_THAT(error_of(tum), AllOf(HasSubstr("desk"), HasSubstr("--camera FILE")));
  tum.camera_file = camera("");
  const auto source = open_source(tum);
  EXPECT_EQ(source->kind, "TUM RGB-D recording");
  EXPECT_EQ(source->name, "desk");
  ASSERT_EQ(source->size(), 6U);
  EXPECT_NEAR(source->time_s(0), 1305031452.791720, 1e-6);
  expect_frame(source->read(3), 3);
  EXPECT_THAT((*source->ground_truth_of(6))->frames, ElementsAre(0, 1, 3, 4, 5)) << "0.01 s";
  tum.ground_truth_tolerance_s = 0.016;
  EXPECT_THAT((*open_source(tum)->ground_truth_of(6))->frames, ElementsAre(0, 1, 2, 3, 4, 5));
  tum.ground_truth_tolerance_s = 0.001;
  EXPECT_THAT(error_of(tum), AllOf(HasSubstr("groundtruth.txt"), HasSubstr("0.001 s"),
                                   HasSubstr("--gt-tolerance")));
}

TEST_F(Recordings, ListsOfImagesAreChecked) {
  FrameSourceRequest tum = with_camera(write_tum());
  fs::remove(temp_ / "desk/groundtruth.txt");
  const auto error_with = [&](const std::string& list) {
    (void)temp_.file("desk/rgb.txt", list);
    return error_of(tum);
  };
  EXPECT_THAT(error_with("# nothing\n"), HasSubstr("expected rows of a time and an image"));
  EXPECT_THAT(error_with("1.0 rgb/a.png\n1.0 rgb/b.png\n"),
              HasSubstr("rgb.txt:2: expected a time"));
  EXPECT_THAT(error_with("1.0 my photo.png\n"), HasSubstr("rgb.txt:1: expected a time and"));
  EXPECT_THAT(error_with("one rgb/a.png\n"), HasSubstr("rgb.txt:1: "));
  EXPECT_THAT(error_with("1.0 rgb/a.png\n"), HasSubstr("none of 1 images can be read"));
}

TEST_F(Recordings, AVideoIsReadFrameByFrame) {
  FrameSourceRequest video = request(write_video());
  EXPECT_THAT(error_of(video), AllOf(HasSubstr("a video"), HasSubstr("--camera FILE")));
  video.camera_file = camera("");
  video.frames = FrameRangeRequest{1, std::nullopt};
  const auto source = open_source(video);
  EXPECT_EQ(source->kind, "video");
  EXPECT_EQ(source->name, "drive");
  ASSERT_TRUE(source->stream);
  EXPECT_EQ(source->stream->expected_frames, 5U);
  for (std::size_t i = 0; i < 5; ++i) {
    expect_frame(source->read(i), static_cast<int>(i) + 1);
    EXPECT_NEAR(source->time_s(i), 0.04 * static_cast<double>(i + 1), 1e-3);
  }
  const auto behind = source->read(5).value();
  EXPECT_TRUE(behind.empty());
  EXPECT_THAT(source->warnings, IsEmpty());
  video.rate_hz = 50.0;
  EXPECT_THAT(open_source(video)->warnings, ElementsAre(HasSubstr("--rate 50: ")));
  video.rate_hz.reset();
  video.camera_file = camera("rate_hz: 25\n");
  EXPECT_THAT(open_source(video)->warnings, IsEmpty());
  video.camera_file = camera("rate_hz: 10\n");
  video.frames = FrameRangeRequest{1, 9};
  EXPECT_THAT(open_source(video)->warnings,
              ElementsAre(HasSubstr("rate_hz 10: "), HasSubstr("--frames 1:9: ")));
}

TEST_F(Recordings, AVideoIsTurnedAsPlayersDo) {
  cv::Mat picture(kHeight_px, kWidth_px, CV_8UC3, cv::Scalar::all(40));
  picture(cv::Rect(0, 0, 32, 24)) = cv::Scalar::all(200);  // no turn looks like another
  picture(cv::Rect(32, 0, 32, 24)) = cv::Scalar::all(120);
  const fs::path png = temp_ / "corners.png";
  cv::imwrite(png.string(), picture);
  FrameSourceRequest video = request(temp_ / "turned.mp4");
  test::write_video(video.sequence_dir, 25.0, {png, png});
  const std::string plain = read_file(video.sequence_dir);
  std::array<signed char, 4> of_movie = {1, 0, 0, 1};
  const auto with_matrix = [&](const std::array<signed char, 4>& of_track) {
    std::string text = plain;
    constexpr std::size_t kPlaces[] = {0, 4, 12, 16};
    for (std::size_t i = 0; i < 8; ++i) {
      const signed char one = i < 4 ? of_track[i] : of_movie[i - 4];
      const char number[] = {static_cast<char>(one < 0 ? -1 : 0), static_cast<char>(one), 0, 0};
      const std::size_t box = i < 4 ? plain.find("tkhd") + 44 : plain.find("mvhd") + 40;
      text.replace(box + kPlaces[i % 4], 4, number, 4);  // numbers of 16.16 bits
    }
    (void)temp_.file("turned.mp4", text);
  };
  const auto expect_first = [&](const cv::Mat& expected, std::size_t num_warnings) {
    video.camera_file =
        temp_.file("turned.yaml", fmt::format("resolution: [{}, {}]\nintrinsics: [60, 61, {}, {}]\n"
                                              "distortion_model: none\n",
                                              expected.cols, expected.rows, 0.5 * expected.cols,
                                              0.5 * expected.rows));
    const auto source = open_source(video);
    ASSERT_TRUE(source) << source.error().message;
    EXPECT_EQ(source->warnings.size(), num_warnings);
    EXPECT_LT(cv::norm(source->read(0).value(), expected, cv::NORM_L1), 4.0 * 3 * 64 * 48);
  };
  with_matrix({1, 0, 0, 1});
  expect_first(picture, 0);
  cv::Mat turned;
  for (const auto& [matrix, rotation] :
       {std::pair(std::array<signed char, 4>{-1, 0, 0, -1}, cv::ROTATE_180),
        {{0, -1, 1, 0}, cv::ROTATE_90_COUNTERCLOCKWISE},
        {{0, 1, -1, 0}, cv::ROTATE_90_CLOCKWISE}}) {
    cv::rotate(picture, turned, rotation);
    with_matrix(matrix);
    expect_first(turned, 1);
  }
  expect_first(picture, 0);  // the camera file's size decides
  const auto expect_mirrored = [&] {
    EXPECT_THAT(error_of(video), AllOf(HasSubstr("turned.mp4"), HasSubstr("mirror")));
  };
  with_matrix({-1, 0, 0, 1});
  expect_mirrored();
  of_movie = {1, 0, 0, -1};
  cv::rotate(picture, turned, cv::ROTATE_180);
  with_matrix({-1, 0, 0, 1});
  expect_first(turned, 1);  // mirrored twice
  with_matrix({1, 0, 0, 1});
  expect_mirrored();
}

TEST_F(Recordings, RawMotionJpegIsCountedAtTheGivenRate) {
  std::string all;
  for (int i = 0; i < kNumFrames; ++i) {
    std::vector<unsigned char> jpeg;
    cv::imencode(".jpg", frame(i), jpeg);
    all.append(jpeg.begin(), jpeg.end());
  }
  FrameSourceRequest video = request(temp_.file("raw.mjpeg", all));
  const auto times_of = [&](const std::string& more) {
    video.camera_file = camera(more);
    const auto source = open_source(video).value();
    std::vector<double> times_s;
    for (std::size_t i = 0; i < 3; ++i) {
      expect_frame(source.read(i), static_cast<int>(i));
      times_s.push_back(source.time_s(i));
    }
    times_s.push_back(source.stream->counted_hz);
    return times_s;
  };
  const auto near = [](double s) { return ::testing::DoubleNear(s, 1e-9); };
  EXPECT_THAT(times_of(""), ElementsAre(0.0, near(1.0 / 30.0), near(2.0 / 30.0), 30.0));
  video.rate_hz = 20.0;
  EXPECT_THAT(times_of(""), ElementsAre(0.0, near(0.05), near(0.1), 20.0));
  EXPECT_THAT(times_of("rate_hz: 10\n"), ElementsAre(0.0, near(0.1), near(0.2), 10.0));
}

TEST_F(Recordings, GrayLevelsThatAVideoLosesAreSaid) {
  FrameSourceRequest video = with_camera(temp_ / "gray.mkv");
  const auto warnings_of = [&](int type) {  // images behind one another: FFmpeg's png_pipe
    std::vector<unsigned char> png;
    cv::imencode(".png", cv::Mat(kHeight_px, kWidth_px, type, cv::Scalar(50)), png);
    (void)temp_.file("gray.mkv", std::string(png.begin(), png.end()));
    return open_source(video)->warnings;
  };
  EXPECT_THAT(warnings_of(CV_8UC1), IsEmpty());
  EXPECT_THAT(warnings_of(CV_16UC1), ElementsAre(HasSubstr("of 16 bits per gray level")));
}

TEST_F(Recordings, WhatIsNoVideoOrOfAnotherSizeIsRefused) {
  FrameSourceRequest video = with_camera(temp_.file("notes.mp4", "no video at all\n"));
  EXPECT_THAT(error_of(video), AllOf(HasSubstr("notes.mp4"), HasSubstr("FFmpeg")));
  video.sequence_dir = write_video();
  video.camera_file = temp_.file(
      "wrong.yaml", "resolution: [32, 24]\nintrinsics: [30, 30, 15, 11]\ndistortion_model: none\n");
  EXPECT_THAT(error_of(video), AllOf(HasSubstr("32x24"), HasSubstr("64x48")));
  video.camera_file = camera("");
  video.frames = FrameRangeRequest{6, std::nullopt};
  EXPECT_THAT(error_of(video),
              HasSubstr("expected more than 6 frames that can be decoded, found 6"));
  EXPECT_THAT(error_of(request(temp_ / "nothing.mp4")), HasSubstr("a video file"));
  video.frames.reset();
  video.times = temp_.file("times.txt", "0\n1\n");
  EXPECT_THAT(error_of(video), HasSubstr("--times"));
}

TEST_F(Recordings, WhatIsMissingOrMeantIsSaid) {
  const fs::path folder = write_euroc();
  fs::remove(folder / "mav0/cam0/sensor.yaml");
  EXPECT_THAT(error_of(request(folder)), HasSubstr("cam0/sensor.yaml: cannot read"));
  fs::remove_all(folder / "mav0/state_groundtruth_estimate0");  // of the body
  EXPECT_EQ(error_of(with_camera(folder)), "no error");
  const std::string one = folder / "mav0/cam0/data/0.png";
  cv::imwrite(one, frame(0));
  EXPECT_THAT(error_of(with_camera(one)),
              HasSubstr("found one image; give its folder, or a quoted pattern"));
}

TEST_F(Recordings, AFileNamedLikeAnAddressIsAFile) {
  fs::rename(write_video(), temp_ / "concat:drive.avi");
  const fs::path here = fs::current_path();
  fs::current_path(temp_.path());
  EXPECT_EQ(error_of(with_camera("concat:drive.avi")), "no error");
  fs::current_path(here);
}

TEST_F(Recordings, ALiveCameraHasTheClocksTimes) {
  const auto video = dataset::VideoStream::open(write_video(), {}).value();
  auto stream = std::make_shared<dataset::VideoStream>(video->decoder(), "camera:0", true);
  const std::string file = camera("");
  FrameSourceRequest live = request("camera:0");
  live.camera_file = file;
  const auto source = dataset::open_stream(stream, *dataset::read_camera_file(file), live);
  EXPECT_EQ(source->kind, "live camera");
  EXPECT_EQ(source->name, "camera0");
  EXPECT_TRUE(source->stream->is_live);
  EXPECT_EQ(source->stream->expected_frames, 0U);
  double last_s = -1.0;
  for (std::size_t i = 0; i < kNumFrames; ++i) {
    expect_frame(source->read(i), static_cast<int>(i));
    EXPECT_GT(source->time_s(i), last_s);
    last_s = source->time_s(i);
  }
  EXPECT_LT(last_s, 10.0) << "from the first frame on";
  EXPECT_TRUE(source->read(kNumFrames)->empty());
}

TEST_F(Recordings, ACameraThatIsNotThere) {
  EXPECT_THAT(error_of(request("camera:987")), HasSubstr("--camera FILE"));
  EXPECT_THAT(error_of(with_camera("camera:987")),
              AllOf(HasSubstr("/dev/video987"), HasSubstr("found none")));
  EXPECT_THAT(error_of(request("camera:x")), HasSubstr("camera:N"));
}

}  // namespace
}  // namespace stemvo
