// SPDX-License-Identifier: MIT
#include "calibration/board.hpp"
#include "calibration/calibrate.hpp"
#include "dataset/camera_file.hpp"
#include "dataset/frame_source.hpp"
#include "geometry/distortion.hpp"
#include "support/rendered_board.hpp"
#include "support/run_program.hpp"
#include "support/test.hpp"
#include "synth/synth.hpp"

namespace stemvo {
namespace {

/// The command in this process, under the sanitizers too: a small walk, its turns ten times a
/// second.
class CalibrateSequence : public ::testing::Test {
 protected:
  static constexpr int kNumFrames = 100;

  CalibrateSequence() {
    EXPECT_TRUE(render_synthetic_drive(folder_.path(), {.walk = true,
                                                        .num_frames = kNumFrames,
                                                        .render = {.walk_rate_hz = 10.0},
                                                        .width_px = 320,
                                                        .height_px = 240}));
    request_.sequence_dir = folder_ / "sequences/00";
    request_.out_file = folder_ / "refined.txt";
  }
  [[nodiscard]] std::string error() const { return message_of(calibrate_sequence(request_)); }

  TempFolder folder_;
  CalibrationRequest request_;
};

TEST_F(CalibrateSequence, StoppedItWritesNothing) {
  const auto report = calibrate_sequence(request_, [](std::size_t done, std::size_t total) {
    EXPECT_EQ(total, std::size_t{kNumFrames});
    return done < 5;
  });
  EXPECT_TRUE(report->interrupted);
  EXPECT_FALSE(fs::exists(request_.out_file));
}

TEST_F(CalibrateSequence, TooFewFramesAndBrokenOnes) {
  request_.frames = FrameRangeRequest{0, 2};
  EXPECT_THAT(error(), AllOf(HasSubstr("that move"), HasSubstr("2 frames")));
  fs::resize_file(request_.sequence_dir / "image_2/000003.png", 50);
  request_.frames.reset();
  const auto report = calibrate_sequence(request_);
  ASSERT_FALSE(report->warnings.empty());
  EXPECT_THAT(report->warnings[0], HasSubstr("000003.png"));
}

// The same images as a folder with a camera file, whose form the result has.
TEST_F(CalibrateSequence, ARecordingGetsACameraFile) {
  const Camera truth = open_kitti(request_.sequence_dir, {}).value().camera;
  request_.sequence_dir = folder_ / "sequences/00/image_2";
  request_.frames = FrameRangeRequest{0, 60};
  request_.camera_file = folder_.file(
      "camera.yaml", fmt::format("image_width: {}\nimage_height: {}\nintrinsics: [{}, {}, {}, {}]\n"
                                 "distortion_model: none\nrate_hz: 10\n",
                                 truth.width_px, truth.height_px, 1.05 * truth.fx_px,
                                 1.05 * truth.fy_px, truth.cx_px, truth.cy_px));
  request_.rate_hz = 25.0;
  const auto report = calibrate_sequence(request_);
  ASSERT_TRUE(report->written);
  EXPECT_THAT(report->warnings, Contains(HasSubstr("rate_hz goes before it")));
  const auto file = dataset::read_camera_file(request_.out_file);
  EXPECT_NEAR(file->camera.fx_px / truth.fx_px, 1.0, 0.02);
  EXPECT_NEAR(file->camera.fx_px, report->refined.fx_px, 1e-3);
  EXPECT_EQ(file->camera.distortion, Distortion::kRadialTangential);
  EXPECT_EQ(file->rate_hz, 10.0);
}

TEST(RefinedLens, ShowsTheWorldAsTheRefinedViewDoes) {
  Camera lens{400.0, 402.0, 330.0, 235.0, 640, 480};
  lens.distortion = Distortion::kRadialTangential;
  lens.distortion_coefficients = {-0.28, 0.07, 0.0002, 0.00002, 0.0};
  const Camera view = undistorted_camera(lens).value();
  IntrinsicsDelta nothing = IntrinsicsDelta::Zero();
  EXPECT_NEAR(refined_lens(lens, view, nothing).fx_px, lens.fx_px, 1e-6);
  IntrinsicsDelta change;
  change << 3.0, -2.0, 0.02, 0.01, -0.003;
  const Camera refined = refined_lens(lens, view, change);
  for (const Eigen::Vector2d& xy : {Eigen::Vector2d(0.5, 0.3), Eigen::Vector2d(-0.4, 0.1)}) {
    const double r_sq = xy.squaredNorm();
    const Eigen::Vector2d bent = xy * (1.0 + r_sq * (change[3] + r_sq * change[4]));
    const Eigen::Vector2d seen(view.fx_px * (1.0 + change[2]) * bent.x() + view.cx_px + change[0],
                               view.fy_px * (1.0 + change[2]) * bent.y() + view.cy_px + change[1]);
    const Eigen::Vector2d in_frame = source_pixel(lens, view, seen);
    const Eigen::Vector2d ours = refined.project(distort(refined, xy).homogeneous());
    EXPECT_LE((ours - in_frame).norm(), 0.3);
  }
}

Camera true_camera() {
  Camera camera{520.9, 521.4, 325.1, 249.7, 640, 480, Distortion::kRadialTangential};
  camera.distortion_coefficients = {-0.28, 0.09, 0.0008, -0.0005};
  return camera;
}

/// The camera by pictures of printed boards, rendered with a camera that is known.
class BoardCalibration : public ::testing::Test {
 protected:
  /// Pictures of the print, the last `num_smeared` of which the camera moved in.
  Expected<BoardReport> try_to_calibrate(const std::string& board,
                                         const Print& print,
                                         int num_pictures,
                                         double max_tilt_rad = 0.6,
                                         int num_smeared = 0) {
    static BoardCamera camera(true_camera());
    const fs::path photos = temp_ / "photos";
    fs::create_directories(photos);
    for (int i = 0; i < num_pictures; ++i) {
      camera.choose_pose(print, max_tilt_rad, random_);
      cv::Mat image = camera.photograph(print, 0.8, random_);
      if (i >= num_pictures - num_smeared) {
        cv::Mat shifted;
        cv::remap(image, shifted, smear(image.size()), cv::noArray(), cv::INTER_LINEAR);
        image = shifted;
      }
      const cv::Point2f middle(319.5F, 239.5F);
      cv::Mat zoomed;
      cv::warpAffine(image, zoomed, cv::getRotationMatrix2D(middle, 0.0, i % 2 == 0 ? 1.0 : zoom_),
                     image.size(), cv::INTER_LINEAR, cv::BORDER_REPLICATE);
      cv::imwrite((photos / fmt::format("{:02}.png", i)).string(), zoomed);
    }
    return calibrate_photos(board);
  }
  Expected<BoardReport> calibrate_photos(const std::string& board = "9x6:0.025",
                                         const std::string& out = "camera.yaml") const {
    return calibrate_board({temp_ / "photos", temp_ / out, parse_board(board).value(), board});
  }
  template <typename... Rest>
  BoardReport calibrate(const Rest&... rest) {
    const auto report = try_to_calibrate(rest...);
    EXPECT_TRUE(report) << report.error().message;
    return report.value_or(BoardReport());
  }
  /// A rolling shutter: rows are shifted the more the lower they are.
  static cv::Mat smear(const cv::Size& size) {
    cv::Mat map(size, CV_32FC2);
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) {
        const double shift = 6.0 * std::sin(0.02 * y);
        map.at<cv::Vec2f>(y, x) = {static_cast<float>(x + shift), static_cast<float>(y)};
      }
    }
    return map;
  }
  /// Within shares of the focal lengths and pixels of the centre, and within what the sigmas say.
  static void expect_true(const BoardFit& fit, double share, double center_px) {
    const Camera truth = true_camera();
    const double values[] = {truth.fx_px, truth.fy_px, truth.cx_px, truth.cy_px,
                             -0.28,       0.09,        0.0008,      -0.0005};
    EXPECT_NEAR(fit.camera.fx_px, truth.fx_px, share * truth.fx_px);
    EXPECT_NEAR(fit.camera.fy_px, truth.fy_px, share * truth.fy_px);
    EXPECT_NEAR(fit.camera.cx_px, truth.cx_px, center_px);
    EXPECT_NEAR(fit.camera.cy_px, truth.cy_px, center_px);
    ASSERT_GE(fit.numbers.size(), 8U);
    for (std::size_t i = 0; i < 8; ++i) {
      EXPECT_GT(fit.numbers[i].sigma, 0.0) << fit.numbers[i].name;
      EXPECT_LT(std::abs(fit.numbers[i].value - values[i]), 5.0 * fit.numbers[i].sigma)
          << fit.numbers[i].name;
    }
  }

  TempFolder temp_;
  cv::RNG random_{7};
  double zoom_ = 1.0;  ///< of every second picture
};

TEST_F(BoardCalibration, AChessboardTellsTheCameraThatTheFileHolds) {
  const BoardReport report = calibrate("9x6:0.025", print_chessboard({9, 6}, 0.025), 25);
  std::cout << format_board_table(report);
  EXPECT_EQ(report.num_pictures, 25U);
  EXPECT_GE(report.views.size(), 24U);
  expect_true(report.fit, 0.001, 0.5);
  EXPECT_LT(report.fit.error_px, 0.15);
  EXPECT_THAT(report.missing, IsEmpty());
  const auto file = dataset::read_camera_file(temp_ / "camera.yaml");
  EXPECT_NEAR(file->camera.fx_px, report.fit.camera.fx_px, 1e-3);
  EXPECT_NEAR(file->camera.distortion_coefficients[0], report.fit.camera.distortion_coefficients[0],
              1e-5);
  EXPECT_THAT(read_file(temp_ / "camera.yaml"),
              HasSubstr("views of the board 9x6:0.025: error 0."));
  EXPECT_EQ(cv::imread((temp_ / "camera_coverage.png").string()).cols, 960);
}

TEST_F(BoardCalibration, BoardsOfMarkersInEveryLayout) {
  const std::string charuco = "charuco:6x4:0.03:0.0225:DICT_4X4_50";
  const std::string grid = "aprilgrid:4x3:0.03:0.009";
  for (const auto& [board, print] :
       {std::pair(charuco, print_charuco({6, 4}, false)),
        std::pair(charuco, print_charuco({6, 4}, true)), std::pair(grid, print_tags(true)),
        std::pair(grid, print_tags(false))}) {
    const BoardReport report = calibrate(board, print, 9);
    EXPECT_GE(report.views.size(), 8U);
    expect_true(report.fit, 0.005, 2.0);
    EXPECT_LT(report.fit.error_px, 0.35);
    EXPECT_THAT(report.warnings, Not(Contains(HasSubstr("err alike"))));
  }
}

TEST_F(BoardCalibration, PicturesOfTwoZoomsAreSaid) {
  for (const double zoom : {1.0, 0.9, 0.8}) {
    zoom_ = zoom;
    const BoardReport report = calibrate("9x6:0.025", print_chessboard({9, 6}, 0.025), 14);
    if (zoom == 1.0) {
      EXPECT_THAT(report.warnings, IsEmpty());
    } else {
      EXPECT_THAT(report.warnings, ElementsAre(HasSubstr("of one zoom"))) << zoom;
    }
  }
}

TEST_F(BoardCalibration, ABoardThatIsNamedWrongIsRefused) {
  for (const auto& [board, print] :
       {std::pair("aprilgrid:4x3:0.03:0.3", print_tags(true)),  // a share of the side
        std::pair("aprilgrid:3x4:0.03:0.009", print_tags(true)),
        std::pair("charuco:4x6:0.03:0.0225:DICT_4X4_50", print_charuco({6, 4}, false))}) {
    EXPECT_THAT(message_of(try_to_calibrate(board, print, 9)),
                HasSubstr("another board than --board says"))
        << board;
    EXPECT_FALSE(fs::exists(temp_ / "camera.yaml"));
  }
}

TEST_F(BoardCalibration, DoubtsAboutThePicturesAreSaid) {
  const Print print = print_chessboard({9, 6}, 0.025);
  EXPECT_THAT(calibrate("9x6:0.025", print, 4).warnings, Not(Contains(HasSubstr("16 bits"))));
  for (const auto& entry : fs::directory_iterator(temp_ / "photos")) {
    cv::Mat deep;
    cv::imread(entry.path().string(), cv::IMREAD_GRAYSCALE).convertTo(deep, CV_16U, 16.0);
    cv::imwrite(entry.path().string(), deep);
  }
  EXPECT_THAT(calibrate_photos()->warnings, Contains(HasSubstr("images of 16 bits: values from")));
}

TEST_F(BoardCalibration, ViewsThatErrAreLeftOutAndSaid) {
  const BoardReport report = calibrate("9x6:0.025", print_chessboard({9, 6}, 0.025), 14, 0.6, 2);
  ASSERT_GE(report.views.size(), 13U);
  for (const BoardView& view : report.views) {
    EXPECT_EQ(view.is_used, view.name < "12.png") << view.name << ": " << view.error_px << " px";
  }
  EXPECT_THAT(format_board_table(report), HasSubstr("left out: 13.png, whose error is"));
  expect_true(report.fit, 0.005, 2.0);
}

TEST_F(BoardCalibration, WhatToPhotographNext) {
  const BoardReport report = calibrate("9x6:0.025", print_chessboard({9, 6}, 0.025), 4, 0.1);
  EXPECT_THAT(report.missing, Contains("its left side nearer, tilted by 20 to 45 degrees"));
  EXPECT_THAT(report.missing, Contains(HasSubstr("views more")));
  // A view from the front in the upper left alone: all else lacks.
  BoardView view;
  view.points = {{{0, 0, 0}, {1, 0, 0}}, {{10, 10}, {300, 100}}};
  view.camera_from_board_t = {0.0, 0.0, 1.0};
  const std::vector<std::string> missing = missing_views({view}, {640, 480});
  EXPECT_THAT(missing.front(), HasSubstr("lower right"));
  EXPECT_THAT(missing, Contains(HasSubstr("from nearer")));
  EXPECT_THAT(missing, Contains(HasSubstr("from farther away")));
}

TEST(Board, FormsAreCheckedBeforeWork) {
  EXPECT_EQ(parse_board("9x6:0.025")->cells, cv::Size(9, 6));
  EXPECT_EQ(parse_board("charuco:7x5:0.04:0.03:DICT_5X5_100")->other_m, 0.03);
  EXPECT_EQ(parse_board("aprilgrid:6x6:0.088:0.0264")->dictionary, "DICT_APRILTAG_36h11");
  for (const char* text :
       {"", "9x6", "9x6:", "9x6:0", "9x6:-1", "9x6:nan", "9:0.025", "9x6x3:0.025", "2x6:0.025",
        "999x6:0.025", "9x6:0.025:3", "charuco:7x5:0.04:0.03", "charuco:7x5:0.03:0.04:DICT_5X5_100",
        "aprilgrid:6x6:0.088", "circles:4x4:1", "charuco", "aprilgrid", "charuco:"}) {
    const auto board = parse_board(text);
    EXPECT_THAT(board.error().message, HasSubstr("--board: expected COLUMNSxROWS:SQUARE_M"))
        << text;
  }
}

TEST_F(BoardCalibration, ParallelBoardsTellNoCamera) {
  EXPECT_THAT(message_of(try_to_calibrate("9x6:0.025", print_chessboard({9, 6}, 0.025), 12, 0.001)),
              HasSubstr("photos: expected boards of different tilts"));
  EXPECT_FALSE(fs::exists(temp_ / "camera.yaml"));
}

TEST_F(BoardCalibration, TooFewViewsAreRefused) {
  const fs::path photos = temp_ / "photos";
  fs::create_directories(photos);
  cv::imwrite((photos / "1.png").string(), cv::Mat(480, 640, CV_8UC1, cv::Scalar(90)));
  EXPECT_THAT(message_of(calibrate_photos()),
              HasSubstr("photos: expected at least 3 pictures with the board, found 0"));
  EXPECT_FALSE(fs::exists(temp_ / "camera.yaml"));
}

}  // namespace
}  // namespace stemvo
