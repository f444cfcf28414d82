// SPDX-License-Identifier: MIT
#include "dataset/frame_files.hpp"
#include "dataset/frame_source.hpp"
#include "dataset/image_names.hpp"
#include "dataset/listing.hpp"
#include "support/matchers.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

constexpr int kNumImages = 4;

/// Four colour JPEGs of 32x24 pixels, frame8 .. frame11; each test breaks them in its own way.
class ImageFolderTest : public ::testing::Test {
 protected:
  void SetUp() override {
    fs::create_directories(images_);
    for (int i = 0; i < kNumImages; ++i) {
      cv::imwrite(image(i), cv::Mat(24, 32, CV_8UC3, cv::Scalar(30, 20, 10 + 40 * i)));
    }
    write_camera("rate_hz: 10\n");
    request_.sequence_dir = images_;
    request_.camera_file = temp_ / "camera.yaml";
  }

  std::string image(int index) const {
    return (images_ / fmt::format("frame{}.jpg", 8 + index)).string();
  }
  void write_camera(const std::string& more, const std::string& size = "[32, 24]") const {
    (void)temp_.file("camera.yaml", "resolution: " + size +
                                        "\nintrinsics: [30, 31, 15.5, 11.5]\n"
                                        "distortion_model: none\n" +
                                        more);
  }
  std::string error_of() const { return message_of(open_source(request_)); }

  TempFolder temp_;
  const fs::path images_ = temp_ / "my drive";
  FrameSourceRequest request_;
};

TEST_F(ImageFolderTest, OpensAFolder) {
  const FrameSource source = open_source(request_).value();
  EXPECT_EQ(source.size(), 4U);
  EXPECT_EQ(source.name, "my drive");
  EXPECT_THAT(numbers_of(source.camera), ElementsAre(30.0, 31.0, 15.5, 11.5, 32, 24));
  EXPECT_THAT(source.timestamps_s, ElementsAre(0.0, 0.1, 0.2, 3 / 10.0));
  EXPECT_FALSE(source.ground_truth);
  EXPECT_FALSE(source.camera_height_m);
  EXPECT_EQ(source.given_calibration, request_.camera_file);
  for (std::size_t i = 0; i < source.size(); ++i) {
    EXPECT_EQ(source.files[i], image(static_cast<int>(i))) << "frame8, frame9, frame10, frame11";
    const auto frame = source.read(i);
    ASSERT_EQ(frame->type(), CV_8UC3);
    const auto rgb = frame->at<cv::Vec3b>(12, 16);
    EXPECT_NEAR(rgb[0], 10 + 40 * static_cast<int>(i), 3) << "red first";
    EXPECT_NEAR(rgb[2], 30, 3);
  }
}

TEST_F(ImageFolderTest, OpensAPattern) {
  request_.sequence_dir = images_ / "frame?.jpg";
  const auto opened = open_source(request_);
  EXPECT_EQ(opened->size(), 2U);
  EXPECT_EQ(opened->name, "my drive_frame");
  EXPECT_EQ(dataset::recording_name("first/images"), "first");
  EXPECT_EQ(dataset::recording_name("second/mav0/cam0/data/"), "second");
}

TEST_F(ImageFolderTest, RangeCutsEverythingAndStartsTheTruthAtIdentity) {
  request_.frames = parse_frame_range("1:3").value();
  request_.ground_truth = temp_.file("poses.txt", pose_lines(kNumImages));
  request_.times = temp_.file("times.txt", "5\n5.5\n6.25\n7\n");
  write_camera("camera_height: 1.25\n");  // no rate: there are times
  const FrameSource source = open_source(request_).value();
  EXPECT_EQ(source.size(), 2U);
  EXPECT_EQ(source.range.begin, 1U);
  EXPECT_EQ(source.range.end, 3U);
  EXPECT_THAT(source.timestamps_s, ElementsAre(5.5, 6.25));
  EXPECT_EQ(source.files[0], image(1));
  EXPECT_EQ(source.camera_height_m, 1.25);
  ASSERT_TRUE(source.ground_truth);
  ASSERT_EQ(source.ground_truth->poses.size(), 2U);
  EXPECT_EQ(source.ground_truth->poses.front().translation, Eigen::Vector3d::Zero());
  EXPECT_NEAR(source.ground_truth->poses.back().translation.z(), 2.0, 1e-12);
  EXPECT_EQ(source.ground_truth_file, request_.ground_truth);
}

TEST_F(ImageFolderTest, GrayImagesAreReadAsGray) {
  for (int i = 0; i < kNumImages; ++i) {
    fs::remove(image(i));
    const std::string file = (images_ / fmt::format("{}.{}", i, i % 2 == 0 ? "png" : "jpg"));
    cv::imwrite(file, cv::Mat(24, 32, CV_8UC1, cv::Scalar(40 + i)));
  }
  const auto opened = open_source(request_);
  for (std::size_t i = 0; i < 4; ++i) {
    const auto frame = opened->read(i);
    ASSERT_EQ(frame->type(), CV_8UC1);
    EXPECT_EQ(frame->at<std::uint8_t>(3, 4), 40 + i);
  }
}

TEST_F(ImageFolderTest, OneGrayImageAmongColourIsMadeColourAndOneOfAnotherSizeIsAnError) {
  cv::imwrite(image(2), cv::Mat(24, 32, CV_8UC1, cv::Scalar(77)));
  cv::imwrite(image(3), cv::Mat(12, 16, CV_8UC3, cv::Scalar(1, 2, 3)));
  const auto opened = open_source(request_);
  EXPECT_EQ(opened->read(2).value().type(), CV_8UC3);
  EXPECT_THAT(opened->read(3).error().message,
              HasSubstr("frame11.jpg: expected an image of 32x24 pixels, found 16x12"));
}

TEST_F(ImageFolderTest, AnEndingThatLiesDoesNoHarm) {
  cv::imwrite((temp_ / "really.png").string(), cv::Mat(24, 32, CV_8UC3, cv::Scalar(1, 2, 3)));
  fs::rename(temp_ / "really.png", image(1));
  const auto opened = open_source(request_);
  EXPECT_EQ(opened->read(1).value().at<cv::Vec3b>(0, 0), cv::Vec3b(3, 2, 1));
}

TEST_F(ImageFolderTest, AJpegCutOffAnywhereIsAnErrorOfThatFrameOnly) {
  cv::Mat noise(24, 32, CV_8UC3);
  cv::randu(noise, 0, 255);
  cv::imwrite(image(2), noise);
  const auto size = fs::file_size(image(2));
  for (std::uintmax_t left = 0; left < size; left += left < 700 ? 37 : 5) {
    cv::imwrite(image(2), noise);
    fs::resize_file(image(2), left);
    const auto opened = open_source(request_);
    const auto frame = opened->read(2);
    ASSERT_FALSE(frame) << left << " of " << size << " bytes";
    EXPECT_THAT(frame.error().message, HasSubstr("frame10.jpg: expected"));
    EXPECT_TRUE(opened->read(3));
  }
}

TEST_F(ImageFolderTest, AThumbnailIsNotTheEndOfAJpeg) {
  std::string text = read_all(image(1));
  // An application segment of 8 bytes that holds an end marker, as EXIF's thumbnails do.
  text.insert(2, std::string("\xff\xe1\x00\x08\xff\xd8\xff\xd9\x00\x00", 10));
  std::ofstream(image(1), std::ios::binary) << text;
  EXPECT_TRUE(open_source(request_).value().read(1));
  std::ofstream(image(1), std::ios::binary) << text.substr(0, 14);
  EXPECT_FALSE(open_source(request_).value().read(1));
}

TEST_F(ImageFolderTest, SizeOtherThanTheCamerasIsRefused) {
  write_camera("rate_hz: 10\n", "[24, 32]");
  EXPECT_THAT(error_of(), AllOf(HasSubstr("my drive: expected images of 24x32 pixels"),
                                HasSubstr("camera.yaml"), HasSubstr("found 32x24")));
}

TEST_F(ImageFolderTest, ARateCountsTimesWhereNothingSaysThem) {
  const auto open = [&](const std::string& camera, std::optional<double> rate_hz) {
    write_camera(camera);
    request_.frames = FrameRangeRequest{1};
    request_.rate_hz = rate_hz;
    return open_source(request_).value();
  };
  const FrameSource usual = open("", std::nullopt);
  EXPECT_THAT(usual.timestamps_s, ElementsAre(1.0 / 30.0, 2.0 / 30.0, 3.0 / 30.0));
  EXPECT_THAT(usual.notes, ElementsAre(HasSubstr("30 frames per second are taken for granted")));
  const FrameSource asked = open("", 20.0);
  EXPECT_THAT(asked.timestamps_s, ElementsAre(0.05, 0.1, 0.15));
  EXPECT_THAT(asked.notes, IsEmpty());
  const FrameSource both = open("rate_hz: 10\n", 20.0);
  EXPECT_THAT(both.timestamps_s, ElementsAre(0.1, 0.2, 3.0 / 10.0));
  EXPECT_THAT(both.warnings, ElementsAre(HasSubstr("--rate 20: the camera file's rate_hz")));
  request_.times = temp_.file("times.txt", "0\n1\n2\n3\n");
  EXPECT_THAT(error_of(), HasSubstr("--rate 20: expected images without times, found"));
}

TEST_F(ImageFolderTest, Times) {
  write_camera("");
  const auto with_times = [&](const std::string& text) {
    request_.times = temp_.file("times.txt", text);
    return error_of();
  };
  EXPECT_EQ(with_times("0\n1\n2\n3\n"), "no error");
  EXPECT_THAT(with_times("0\n1\n2\n"), HasSubstr("times.txt: expected a time for each of 4"));
  EXPECT_THAT(with_times("0\n1\n2\n3\n4\n"),
              AllOf(HasSubstr("times.txt: expected a time for each"), HasSubstr("found 5 times")));
  EXPECT_THAT(with_times("0\n1\n1\n3\n"), HasSubstr("times.txt:3: expected a time after 1 s"));
  EXPECT_THAT(with_times("0\nnan\n2\n3\n"), HasSubstr("times.txt:2: expected a finite number"));
  request_.times = temp_ / "none.txt";
  EXPECT_THAT(error_of(), HasSubstr("none.txt"));
}

TEST_F(ImageFolderTest, NeitherCameraFileNorKittisLayout) {
  request_.camera_file.reset();
  const std::string next =
      "expected --camera FILE, or camera.yaml in their folder, found neither; 'stemvo run --help'";
  EXPECT_THAT(error_of(), HasSubstr("my drive: images: " + next));
  request_.sequence_dir = temp_ / "none";
  EXPECT_THAT(error_of(), HasSubstr("none: expected a folder, a video file"));
  request_.sequence_dir = images_ / "*.jpg";
  EXPECT_THAT(error_of(), HasSubstr("*.jpg: images: " + next));
  fs::create_directories(temp_ / "root/sequences");
  request_.sequence_dir = temp_ / "root";
  EXPECT_THAT(error_of(),
              HasSubstr("root: expected one recording, found a folder of them; give one"));
  request_.sequence_dir = temp_ / "root/sequences";
  EXPECT_THAT(error_of(),
              HasSubstr("or images, found none of them; 'stemvo run --help' shows each"));
  request_.sequence_dir = images_;
  request_.times = temp_.file("times.txt", "0\n1\n2\n3\n");
  EXPECT_THAT(error_of(), HasSubstr("times.txt: expected --times beside --camera only"));
}

TEST_F(ImageFolderTest, BagsAreNamedWithWhatReadsThem) {
  request_.camera_file.reset();
  request_.sequence_dir = temp_.file("drive.mcap", "");
  EXPECT_THAT(error_of(),
              HasSubstr("drive.mcap: expected a recording, found a ROS bag; 'python -m"));
  fs::create_directories(temp_ / "bag");
  request_.sequence_dir = temp_.file("bag/metadata.yaml", "").parent_path();
  EXPECT_THAT(error_of(), HasSubstr("bag: expected a recording, found a ROS bag"));
}

TEST_F(ImageFolderTest, ACameraFileBesideAKittiCalibrationIsRefused) {
  request_.calibration = temp_ / "calib.txt";
  EXPECT_THAT(error_of(), HasSubstr("calib.txt: expected --camera or --calib"));
  request_.calibration.reset();
  fs::create_directories(temp_ / "00/image_2");
  request_.sequence_dir = temp_ / "00";
  EXPECT_THAT(error_of(), HasSubstr("00: KITTI's layout: expected no --camera, or --calib"));
}

using dataset::comes_before;
using dataset::list_images;

TEST(NaturalOrder, NumbersByTheirValue) {
  for (const auto& [a, b] : {std::pair("0.png", "1.png"),
                             {"2.png", "10.png"},
                             {"10.png", "a.png"},
                             {"a1b2.png", "a1b10.png"},
                             {"a1b10.png", "a2b1.png"},
                             {"frame2.png", "frame10"},
                             {"frame10", "frame0100"},
                             {"1311868169.163498.png", "1311868169.263274.png"},
                             {"99999999999999999998", "99999999999999999999"},
                             {"frame02", "frame2"},  // of equals, character by character
                             {"frame02a", "frame2b"},
                             {"frame", "frame1"},
                             {"a9", "b1"},
                             {"000", "1"}}) {
    EXPECT_TRUE(comes_before(a, b)) << a;
    EXPECT_FALSE(comes_before(b, a)) << b;
  }
}

class ImageList : public ::testing::Test {
 protected:
  void touch(const std::string& name) const { (void)folder_.file(name, "x"); }
  static std::vector<std::string> names(const fs::path& path) {
    const auto list = list_images(path);
    std::vector<std::string> result;
    for (const fs::path& file : list->files) {
      result.push_back(file.filename().string());
    }
    return result;
  }
  static std::string error_of(const fs::path& path) { return message_of(list_images(path)); }
  TempFolder folder_;
};

TEST_F(ImageList, ImagesOfAFolderInTheirOrder) {
  for (const char* name : {"f10.png", "f2.JPG", "f1.jpeg", "notes.txt", ".f0.png", "._f2.jpg"}) {
    touch(name);
  }
  fs::create_directories(folder_ / "f3.png");
  EXPECT_THAT(names(folder_.path()), ElementsAre("f1.jpeg", "f2.JPG", "f10.png"));
  EXPECT_THAT(names(folder_.path() / ""), ElementsAre("f1.jpeg", "f2.JPG", "f10.png"));
}

TEST_F(ImageList, ImagesOfAPattern) {
  for (const char* name : {"left_10.png", "left_9.png", "right_9.png", "left_8.txt"}) {
    touch(name);
  }
  EXPECT_THAT(names(folder_ / "left_*"), ElementsAre("left_9.png", "left_10.png"));
  EXPECT_THAT(names(folder_ / "*_?.png"), ElementsAre("left_9.png", "right_9.png"));
  EXPECT_THAT(names(folder_ / "[l-m]*_[8-9].png"), ElementsAre("left_9.png"));
  EXPECT_THAT(error_of(folder_ / "up_*.png"), HasSubstr("up_*.png: expected images"));
}

TEST_F(ImageList, AFolderWhoseNameHasWildcardsIsAFolder) {
  fs::create_directories(folder_ / "what?");
  (void)folder_.file("what?/a.png", "x");
  EXPECT_THAT(names(folder_ / "what?"), ElementsAre("a.png"));
  EXPECT_THAT(names(folder_ / "what?" / "*.png"), ElementsAre("a.png"));
}

TEST_F(ImageList, Problems) {
  EXPECT_THAT(error_of(folder_ / "none"), HasSubstr("none: expected a folder of images"));
  EXPECT_THAT(error_of(folder_ / "none" / "*.png"), HasSubstr("none: expected a folder of images"));
  EXPECT_THAT(error_of(folder_ / "*" / "a.png"),
              HasSubstr("expected *, ? and [..] in the last part"));
  EXPECT_THAT(error_of(folder_ / "*" / "*.png"),
              HasSubstr("expected *, ? and [..] in the last part"));
  EXPECT_THAT(error_of(folder_.path()), HasSubstr("expected images (.png, .jpg, .jpeg), found"));
  EXPECT_THAT(error_of(folder_.file("a.png", "x")), HasSubstr("expected a folder of images"));
}

}  // namespace
}  // namespace stemvo
