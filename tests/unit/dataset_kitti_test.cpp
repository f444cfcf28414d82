// SPDX-License-Identifier: MIT
#include "dataset/frame_files.hpp"
#include "dataset/frame_source.hpp"
#include "support/matchers.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

constexpr int kNumFrames = 4;

/// A sound sequence of 4 colour frames, 8x6 pixels, in a folder of its own; each test breaks it.
class KittiSequenceTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = root_ / "sequences" / "07";
    fs::create_directories(folder_ / "image_2");
    fs::create_directories(root_ / "poses");
    for (int i = 0; i < kNumFrames; ++i) {
      const cv::Mat bgr(6, 8, CV_8UC3, cv::Scalar(30, 20, 10 + i));
      cv::imwrite(image(i).string(), bgr);
    }
    write(folder_ / "calib.txt",
          "P0: 90 0 3 0 0 90 2 0 0 0 1 0\nP2: 100 0 4 5 0 101 3 0 0 0 1 0\n");
    write(folder_ / "times.txt", "0\n0.1\n0.2\n0.3\n");
    write(poses(), pose_lines(kNumFrames));
  }

  fs::path image(int index) const { return folder_ / "image_2" / fmt::format("{:06}.png", index); }
  fs::path poses() const { return root_ / "poses" / "07.txt"; }
  static void write(const fs::path& file, const std::string& text) { std::ofstream(file) << text; }
  std::string open_error(const SequenceOptions& options = {}) const {
    return message_of(open_kitti(folder_, options));
  }
  std::string error_with(const std::string& calibration) const {
    write(folder_ / "calib.txt", calibration);
    return open_error();
  }
  static SequenceOptions frames(const std::string& text) {
    return {.frames = parse_frame_range(text).value()};
  }

  TempFolder temp_;
  const fs::path root_ = temp_.path();
  fs::path folder_;
};

TEST_F(KittiSequenceTest, OpensASoundFolder) {
  const auto sequence = open_kitti(folder_);
  EXPECT_EQ(sequence->size(), 4U);
  EXPECT_EQ(sequence->name, "07");
  EXPECT_THAT(numbers_of(sequence->camera), ElementsAre(100.0, 101.0, 4.0, 3.0, 8, 6));
  const auto frame = sequence->read(1);
  ASSERT_EQ(frame->type(), CV_8UC3);
  EXPECT_EQ(frame->at<cv::Vec3b>(0, 0), cv::Vec3b(11, 20, 30)) << "RGB order";
}

TEST_F(KittiSequenceTest, MorePosesThanImagesAreSaid) {
  EXPECT_THAT(open_kitti(folder_)->warnings, Not(Contains(HasSubstr("poses for"))));
  EXPECT_THAT(open_kitti(folder_, frames("1:3"))->warnings, Not(Contains(HasSubstr("poses for"))));
  write(poses(), pose_lines(8));
  EXPECT_THAT(open_kitti(folder_)->warnings, Contains(HasSubstr("07.txt: 8 poses for 4 frames")));
}

TEST_F(KittiSequenceTest, GivenPoseFileIsTakenInsteadAndMustExist) {
  write(root_ / "other.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0 0 1 0 0 0 0 1 9\n");
  SequenceOptions options = frames(":2");
  options.ground_truth = root_ / "other.txt";
  const auto sequence = open_kitti(folder_, options);
  EXPECT_NEAR(sequence->ground_truth->poses.back().translation.z(), 9.0, 1e-12);
  options.ground_truth = root_ / "absent.txt";
  EXPECT_THAT(open_error(options), HasSubstr("absent.txt"));
}

TEST_F(KittiSequenceTest, CameraIsChosenAndNeverReplaced) {
  fs::create_directories(folder_ / "image_0");
  cv::imwrite((folder_ / "image_0" / "000000.png").string(), cv::Mat(5, 7, CV_8UC1, cv::Scalar(9)));
  const auto gray = open_kitti(folder_, {.camera = "image_0"});
  EXPECT_EQ(gray->camera.fx_px, 90.0);
  EXPECT_EQ(gray->read(0)->type(), CV_8UC1);
  EXPECT_EQ(open_kitti(folder_)->camera.fx_px, 100.0) << "auto takes image_2";
  EXPECT_THAT(open_error({.camera = "image_3"}), HasSubstr("image_3"));
  EXPECT_THAT(open_error({.camera = "left"}), HasSubstr("expected a folder left, found none"));
}

TEST_F(KittiSequenceTest, FolderProblems) {
  fs::remove(image(1));
  EXPECT_THAT(open_error(), HasSubstr("expected 000001.png next, found 000002.png"));
  for (int i = 0; i < kNumFrames; ++i) {
    fs::remove(image(i));
  }
  EXPECT_THAT(open_error(), HasSubstr("found none"));
  fs::remove_all(folder_ / "image_2");
  EXPECT_THAT(open_error(), EndsWith("image_2 or image_0, found none")) << "calib.txt is there";
}

TEST_F(KittiSequenceTest, CalibrationProblems) {
  EXPECT_THAT(error_with("P0: 90 0 3 0 0 90 2 0 0 0 1 0\n"), HasSubstr("expected a row 'P2:'"));
  EXPECT_THAT(error_with("P2: 100 0 4 5 0 101 3 0 0 0 1\n"),
              HasSubstr("calib.txt:1: expected 12 numbers, found 11"));
  EXPECT_THAT(error_with("P2: 0 0 4 5 0 101 3 0 0 0 1 0\n"),
              HasSubstr("focal lengths of at least 1 pixel"));
  EXPECT_THAT(error_with("P2: 100 7 4 5 0 101 3 0 0 0 1 0\n"), HasSubstr("pinhole"));
  EXPECT_EQ(error_with("corner_dist: 1.0\r\nP_rect_02: 100 0 4 5 0 101 3 0 0 0 1 0\r\n"),
            "no error")
      << "the raw data's name, lines ended by CR LF";
}

TEST_F(KittiSequenceTest, ImagesOfAnotherSizeThanTheRawCalibrationSaysAreRefused) {
  const std::string camera = "P_rect_02: 100 0 4 5 0 101 3 0 0 0 1 0\n";
  EXPECT_EQ(error_with("S_02: 9 7\nS_rect_02: 8.0e+00 6.0e+00\n" + camera), "no error");
  EXPECT_EQ(error_with("S_rect_03: 9 7\n" + camera), "no error") << "another camera's";
  for (const std::string& text :
       {"S_rect_02: 9.0e+00 6.0e+00\n" + camera, camera + "S_rect_02: 9 6\n"}) {
    EXPECT_THAT(error_with(text), AllOf(HasSubstr("image_2: expected images of 9x6 pixels, as"),
                                        HasSubstr("calib.txt says, found 8x6")));
  }
  EXPECT_THAT(error_with("S_rect_02: 8\n" + camera),
              HasSubstr("calib.txt:1: expected 2 numbers, found 1"));
  EXPECT_THAT(error_with("S_rect_02: 1e20 -1\n" + camera), HasSubstr("expected images of"));
}

TEST_F(KittiSequenceTest, PoseProblems) {
  write(poses(), pose_lines(3));
  EXPECT_THAT(open_error(), HasSubstr("found 3 poses"));
  EXPECT_EQ(open_error(frames("0:3")), "no error");
  write(poses(), "1 2 3\n");
  EXPECT_THAT(open_error(), HasSubstr("07.txt:1"));
}

TEST_F(KittiSequenceTest, RangeOutsideTheFolder) {
  EXPECT_THAT(open_error(frames("2:5")), HasSubstr("inside 0:4, found --frames 2:5"));
  EXPECT_THAT(open_error(frames("4:")), HasSubstr("inside 0:4, found --frames 4:"));
}

TEST_F(KittiSequenceTest, BrokenFirstImageDoesNotHideTheSize) {
  write(image(0), "not an image");
  write(image(1), "");
  cv::imwrite(image(3).string(), cv::Mat(6, 9, CV_8UC3, cv::Scalar(0, 0, 0)));
  const auto sequence = open_kitti(folder_);
  EXPECT_EQ(sequence->camera.width_px, 8);
  EXPECT_THAT(sequence->read(0).error().message, HasSubstr("another kind of file"));
  EXPECT_THAT(sequence->read(1).error().message,
              HasSubstr("000001.png: expected a PNG or JPEG image, found an empty"));
  EXPECT_TRUE(sequence->read(2));
  EXPECT_THAT(sequence->read(3).error().message, HasSubstr("8x6 pixels, found 9x6"));
  for (int i = 0; i < kNumFrames; ++i) {
    write(image(i), "");
  }
  EXPECT_THAT(open_error(), HasSubstr("none of 4 images can be read"));
}

TEST(FrameRangeTest, AcceptsTheThreeForms) {
  const auto both = parse_frame_range("3:10").value();
  EXPECT_EQ(both.begin, 3U);
  EXPECT_EQ(both.end, 10U);
  EXPECT_EQ(parse_frame_range("7:")->end, std::nullopt);
  EXPECT_EQ(parse_frame_range(":7")->begin, 0U);
}

TEST(FrameRangeTest, RefusesTheRest) {
  for (const char* text : {"", ":", "5", "5:5", "6:5", "-1:5", "a:5", "1:b", "1:2:3", " 1:2",
                           "1.5:3", ":0", "1:99999999999999999999999"}) {
    EXPECT_THAT(message_of(parse_frame_range(text)), HasSubstr(fmt::format("found '{}'", text)));
  }
}

const std::string kText =
    "P0: 700 0 600 0 0 700 180 0 0 0 1 0\n"
    "P1: 700 0 600 -350 0 700 180 0 0 0 1 0\n"
    "P2: 700 0 600 44.8 0 700 180 0.1 0 0 1 0.004\n"
    "P3: 650 0 610 -300 0 650 190 0 0 0 1 0\n"
    "Tr: 1 0 0 0 0 1 0 0 0 0 1 0\n";
const Camera kGiven{700.0, 700.0, 600.0, 180.0, 1241, 376};
const Camera kRefined{707.0, 707.0, 603.0, 178.0, 1241, 376};

TEST(KittiCamera, RowsOfTheSameCameraChangeAndBaselinesStay) {
  const TempFolder folder;
  const auto text =
      dataset::replace_kitti_camera(folder.file("calib.txt", kText), kGiven, kRefined);
  ASSERT_TRUE(text.has_value()) << text.error().message;
  const auto file = folder.file("refined.txt", *text);
  for (int i = 0; i < 4; ++i) {
    const auto camera = dataset::read_kitti_camera(file, i).value();
    EXPECT_NEAR(camera.fx_px, i == 3 ? 650.0 : 707.0, 1e-9) << i;
    EXPECT_NEAR(camera.cx_px, i == 3 ? 610.0 : 603.0, 1e-9) << i;
    EXPECT_NEAR(camera.cy_px, i == 3 ? 190.0 : 178.0, 1e-9) << i;
  }
  EXPECT_THAT(*text, HasSubstr("P3: 650 0 610 -300 0 650 190 0 0 0 1 0\n"));
  EXPECT_THAT(*text, HasSubstr("\nTr: 1 0 0 0 0 1 0 0 0 0 1 0\n"));
  // P1: half a metre to the side; P2: K^-1 (44.8, 0.1, 0.004).
  EXPECT_THAT(*text, HasSubstr("-3.535000000000e+02"));
  const Eigen::Vector3d offset(44.8 - 600.0 * 0.004, 0.1 - 180.0 * 0.004, 0.004 * 700.0);
  const double expected = 707.0 * offset.x() / 700.0 + 603.0 * 0.004;
  std::istringstream row(text->substr(text->find("P2:") + 3));
  const std::vector<double> values{std::istream_iterator<double>(row), {}};
  ASSERT_EQ(values.size(), 12U);
  EXPECT_NEAR(values[3], expected, 1e-9);
  EXPECT_NEAR(values[7], 707.0 * offset.y() / 700.0 + 178.0 * 0.004, 1e-9);
  EXPECT_NEAR(values[11], 0.004, 1e-12);
}

}  // namespace
}  // namespace stemvo
