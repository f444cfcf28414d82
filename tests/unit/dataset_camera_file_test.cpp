// SPDX-License-Identifier: MIT
#include "dataset/camera_file.hpp"
#include "support/matchers.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

using dataset::read_camera_file;

constexpr const char* kGood =
    "image_width: 640\nimage_height: 480\ncamera_model: pinhole\n"
    "intrinsics: [520.9, 521.0, 325.1, 249.7]\ndistortion_model: radial-tangential\n"
    "distortion_coefficients: [0.2312, -0.7849, -0.0033, -0.0001, 0.9172]\nrate_hz: 10\n"
    "camera_height: 1.2\n";

/// kGood with line `number` (from 1) replaced.
std::string with_line(int number, const std::string& line) {
  std::string text = kGood;
  std::size_t begin = 0;
  for (int i = 1; i < number; ++i) {
    begin = text.find('\n', begin) + 1;
  }
  return text.replace(begin, text.find('\n', begin) - begin, line);
}

class CameraFileTest : public ::testing::Test {
 protected:
  std::string error_of(const std::string& text) const {
    return message_of(read_camera_file(folder_.file("camera.yaml", text)));
  }
  /// All of the words, the file's name first.
  void expect_refused(const std::string& text, const std::vector<std::string>& words) const {
    const std::string message = error_of(text);
    EXPECT_THAT(message, HasSubstr((folder_ / "camera.yaml").string()));
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
    for (const std::string& word : words) {
      EXPECT_THAT(message, HasSubstr(word));
    }
  }

  TempFolder folder_;
};

TEST_F(CameraFileTest, ReadsEveryKey) {
  const auto file = read_camera_file(folder_.file("camera.yaml", kGood));
  EXPECT_THAT(numbers_of(file->camera), ElementsAre(520.9, 521.0, 325.1, 249.7, 640, 480));
  EXPECT_EQ(file->camera.distortion, Distortion::kRadialTangential);
  EXPECT_EQ(file->camera.distortion_coefficients,
            (std::array<double, 12>{0.2312, -0.7849, -0.0033, -0.0001, 0.9172}));
  EXPECT_EQ(file->rate_hz, 10.0);
  EXPECT_EQ(file->camera_height_m, 1.2);
}

TEST_F(CameraFileTest, NoYaml) {
  expect_refused("intrinsics: [1, 2\n", {"camera.yaml:2", "not YAML"});
  expect_refused("\x89PNG\r\n\x1a\n", {"camera.yaml:1"});
  expect_refused("", {"expected image_width and image_height, or resolution"});
  expect_refused("just words\n", {"camera.yaml:1: expected keys with values"});
  expect_refused(std::string(kGood) + "rate_hz: 20\n", {"camera.yaml:9: rate_hz: duplicated key"});
}

TEST_F(CameraFileTest, MissingKeys) {
  expect_refused(with_line(1, ""), {"expected image_width and image_height, found image_height"});
  expect_refused(with_line(2, "resolution: [640, 480]"), {"found image_width alone"});
  expect_refused(with_line(1, "").replace(1, 17, ""),
                 {"image_width and image_height, or resolution", "no such key"});
  expect_refused(with_line(4, ""), {"intrinsics: [fx, fy, cx, cy]", "no such key"});
  expect_refused(with_line(5, ""), {"distortion_model: none, radial-tangential or equidistant"});
  expect_refused(with_line(6, ""), {"distortion_coefficients: [k1, k2, p1, p2]", "no such key"});
}

TEST_F(CameraFileTest, UnknownKeysAreRefused) {
  expect_refused(with_line(7, "rate: 10"), {"camera.yaml:7: rate: unknown key", "rate_hz"});
  expect_refused(with_line(8, "scale: {camera_height_m: 1.2}"), {"camera.yaml:8: scale: unknown"});
}

TEST_F(CameraFileTest, OddSizes) {
  for (const char* size : {"0", "-640", "640.5", "nan", "1e9", "wide", "[640]", ""}) {
    expect_refused(with_line(1, std::string("image_width: ") + size), {"image_width: expected"});
  }
  expect_refused(with_line(2, "image_height: 0"), {"camera.yaml:2", "found 0"});
  expect_refused(with_line(1, "resolution: [640]").replace(18, 18, "\n"),
                 {"camera.yaml:1: resolution: expected [width, height], found 1 numbers"});
}

TEST_F(CameraFileTest, OddIntrinsics) {
  const auto refused = [&](const std::string& numbers, const std::vector<std::string>& words) {
    expect_refused(with_line(4, "intrinsics: " + numbers), {"camera.yaml:4: intrinsics: expected"});
    expect_refused(with_line(4, "intrinsics: " + numbers), words);
  };
  refused("[520, 520, 320]", {"[fx, fy, cx, cy]", "found 3"});
  refused("520", {"expected a list of numbers", "'520'"});
  refused("[-520, 520, 320, 240]", {"focal lengths above 0", "-520"});
  refused("[520, 0, 320, 240]", {"focal lengths above 0", "and 0"});
  refused("[520, nan, 320, 240]", {"expected a finite number", "nan"});
  refused("[520, .inf, 320, 240]", {"expected a finite number", "inf"});
  refused("[520, x, 320, 240]", {"expected a finite number", "'x'"});
  refused("[520, 520, 640, 240]", {"principal point inside images of 640x480", "(640, 240)"});
  refused("[520, 520, 320, -1]", {"principal point inside images of 640x480", "(320, -1)"});
  expect_refused(with_line(3, "camera_model: omni"),
                 {"camera.yaml:3: camera_model: expected one of pinhole, found 'omni'"});
}

TEST_F(CameraFileTest, OddDistortion) {
  expect_refused(with_line(5, "distortion_model: fov"),
                 {"camera.yaml:5: distortion_model: expected one of none, radial-tangential, "
                  "radtan, plumb_bob, rational_polynomial, equidistant, fisheye, found 'fov'"});
  expect_refused(with_line(5, "distortion_model: [none]"), {"camera.yaml:5", "expected one value"});
  expect_refused(with_line(5, "distortion_model: equidistant"),
                 {"camera.yaml:6", "[k1, k2, k3, k4], found 5"});
  expect_refused(with_line(5, "distortion_model: none"), {"camera.yaml:6", "[]", "found 5"});
  expect_refused(with_line(6, "distortion_coefficients: [0.1, 0.2, 0.3]"),
                 {"camera.yaml:6", "[k1, k2, p1, p2]", "found 3"});
  expect_refused(with_line(6, "distortion_coefficients: [0.1, .nan, 0, 0]"),
                 {"camera.yaml:6", "expected a finite number", "nan"});
}

TEST_F(CameraFileTest, OddRateAndHeight) {
  for (const char* number : {"0", "-10", "nan", "1e300", "fast", ""}) {
    expect_refused(with_line(7, std::string("rate_hz: ") + number), {"rate_hz: expected"});
    expect_refused(with_line(8, std::string("camera_height: ") + number),
                   {"camera_height: expected"});
  }
  expect_refused(with_line(7, "rate_hz: 0"), {"camera.yaml:7", "from 1e-09 to 100000", "found 0"});
}

constexpr const char* kKalibr =
    "cam0:\n  T_cam_imu:\n  - [0.0, 1.0, 0.0, 0.5]\n  - [-1.0, 0.0, 0.0, 0.0]\n"
    "  - [0.0, 0.0, 1.0, 0.0]\n  - [0.0, 0.0, 0.0, 1.0]\n  cam_overlaps: [1]\n"
    "  camera_model: pinhole\n  distortion_coeffs: [0.1, 0.02, -0.003, 0.0004]\n"
    "  distortion_model: equidistant\n  intrinsics: [190.0, 191.0, 254.0, 256.0]\n"
    "  resolution: [512, 511]\n  rostopic: /cam0/image_raw\n  timeshift_cam_imu: -0.0125\ncam1:\n"
    "  intrinsics: [1, 2, 3, 4]\n";

constexpr const char* kOpenCv =
    "%YAML:1.0\n---\ncalibration_time: \"today\"\nimage_width: 640\nimage_height: 480\nflags: 0\n"
    "camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
    "   data: [ 520., 0., 325.5, 0., 521., 249.5, 0., 0., 1. ]\n"
    "distortion_coefficients: !!opencv-matrix\n   rows: 5\n   cols: 1\n   dt: d\n"
    "   data: [ 0.2, -0.7, 0., 0.001,\n       0.9 ]\navg_reprojection_error: 0.2\n";

constexpr const char* kRos =
    "image_width: 640\nimage_height: 480\ncamera_name: head\ncamera_matrix:\n  rows: 3\n"
    "  cols: 3\n  data: [520, 0, 325.5, 0, 521, 249.5, 0, 0, 1]\ndistortion_model: plumb_bob\n"
    "distortion_coefficients:\n  rows: 1\n  cols: 8\n"
    "  data: [0.2, -0.7, 0, 0.001, 0.9, 0, 0, 0]\nrectification_matrix:\n"
    "  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n";

TEST_F(CameraFileTest, KalibrsChain) {
  const auto file = read_camera_file(folder_.file("camchain.yaml", kKalibr));
  EXPECT_THAT(file->warnings, ElementsAre(HasSubstr("cam0 (/cam0/image_raw) is taken")));
  EXPECT_EQ(file->imu_from_camera_s, -0.0125);
  EXPECT_EQ(file->camera.fy_px, 191.0);
  EXPECT_EQ(file->camera.height_px, 511);
  EXPECT_EQ(file->camera.distortion, Distortion::kEquidistant);
  EXPECT_EQ(file->camera.distortion_coefficients,
            (std::array<double, 12>{0.1, 0.02, -0.003, 0.0004, 0.0}));
  // The camera's centre in the body: -R^T t.
  ASSERT_TRUE(file->body_from_camera);
  EXPECT_LT((file->body_from_camera->translation - Eigen::Vector3d(0, -0.5, 0)).norm(), 1e-12);
  expect_refused(replace_first(kKalibr, "[190.0, ", "["),
                 {"camera.yaml:11: intrinsics: expected [fx, fy, cx, cy], found 3 numbers"});
  expect_refused(replace_first(kKalibr, "pinhole", "omni"),
                 {"camera.yaml:8: camera_model: expected one of pinhole, found 'omni'"});
}

TEST_F(CameraFileTest, OddRowsOfAMatrix) {
  const std::string row = "cam0: {T_cam_imu: [[1, 0, 0, 0], ";
  expect_refused(row + "{a: 1}, [0, 0, 1, 0]]}\n", {"camera.yaml:1: T_cam_imu"});
  expect_refused(row + "0, [0, 0, 1, 0]]}\n", {"camera.yaml:1: T_cam_imu"});
  expect_refused("cam0: {T_cam_imu: [&row [1, 0, 0, 0], *row, *row]}\n", {"camera.yaml"});
}

/// As ROS 2 prints it; `rest` follows `distortion_model: `.
std::string message(const std::string& rest) {
  return "header:\n  stamp:\n    sec: 1\n    nanosec: 2\n  frame_id: head\nheight: 480\nwidth: "
         "640\n"
         "distortion_model: " +
         rest +
         "k:\n- 520.0\n- 0.0\n- 325.5\n- 0.0\n- 521.0\n- 249.5\n- 0.0\n- 0.0\n- 1.0\n"
         "r:\n- 1.0\np:\n- 500.0\nbinning_x: 0\nroi:\n  x_offset: 0\n---\n";
}

TEST_F(CameraFileTest, AMessageOfRos) {
  const std::string five = "plumb_bob\nd:\n- 0.2\n- -0.7\n- 0.0\n- 0.001\n- 0.9\n";
  const auto none = read_camera_file(folder_.file("camera.yaml", message("plumb_bob\nd: []\n")));
  EXPECT_EQ(none->camera.distortion, Distortion::kNone);
  expect_refused(message("rational_polynomial\nd: [1]\n"), {"d: expected [k1, k2, p1, p2]"});
  expect_refused(message("plumb_bob\n"), {"d: [k1, k2, p1, p2]", "no such key"});
  expect_refused(replace_first(message(five), "- 520.0\n", ""),
                 {"camera.yaml:16: k: expected [fx, 0, cx, 0, fy", "found 8 numbers"});
  expect_refused(replace_first(message(five), "width: 640\n", ""),
                 {"expected width and height, found height alone"});
  expect_refused(message(five) + message(five), {"not YAML: expected one document"});
}

TEST_F(CameraFileTest, FisheyesOfOpenCvAndRos) {
  const std::string five = replace_first(kOpenCv, "flags: 0", "fisheye_model: 1");
  expect_refused(five, {"camera.yaml:16: distortion_coefficients: expected [k1, k2, k3, k4]"});
  const auto fisheye = read_camera_file(
      folder_.file("camera.yaml", replace_first(five, "0.001,\n       0.9", "0.001")));
  EXPECT_EQ(fisheye->camera.distortion, Distortion::kEquidistant);
  EXPECT_EQ(error_of(replace_first(kRos, "plumb_bob", "rational_polynomial")), "no error");
  expect_refused(
      replace_first(kRos, "0, 0, 0]", "0, 0, 3]"),
      {"camera.yaml:12: distortion_coefficients: expected [k1, k2, p1, p2]", "found 8 numbers"});
  expect_refused(replace_first(kRos, "[520, ", "["),
                 {"camera.yaml:7: camera_matrix: expected data: [fx, 0, cx", "found 8"});
}

TEST_F(CameraFileTest, FourCoefficientsWithoutAModelMayBeAFisheyes) {
  const auto warnings_of = [&](const std::string& flags, const std::string& lens) {
    const std::string text =
        replace_first(replace_first(kOpenCv, "flags: 0", flags), "0.001,\n       0.9", lens);
    const auto file = read_camera_file(folder_.file("camera.yaml", text));
    EXPECT_EQ(file->camera.distortion, Distortion::kRadialTangential) << text;
    return file->warnings;
  };
  EXPECT_THAT(warnings_of("flags: 0", "0.001, 0.9"), IsEmpty());
  EXPECT_THAT(warnings_of("flags: 0", "0.001"),
              ElementsAre(HasSubstr("taken for k1, k2, p1, p2; a fisheye's need")));
  EXPECT_THAT(warnings_of("fisheye_model: 0", "0.001"), IsEmpty()) << "the file says what it is";
}

TEST_F(CameraFileTest, TheBodyOfEuroc) {
  const std::string head =
      "resolution: [64, 48]\nintrinsics: [50, 50, 31.5, 23.5]\ndistortion_model: none\n";
  const std::string good = "T_BS:\n  cols: 4\n  rows: 4\n  data: [0, -1, 0, 3, 1, 0, 0, 4,";
  const auto file =
      read_camera_file(folder_.file("c.yaml", head + good + " 0, 0, 1, 5, 0, 0, 0, 1]\n"));
  EXPECT_EQ(file->body_from_camera->translation, Eigen::Vector3d(3, 4, 5));
  EXPECT_LT((file->body_from_camera->rotation * Eigen::Vector3d::UnitX() - Eigen::Vector3d::UnitY())
                .norm(),
            1e-12);
  expect_refused(head + good + " 0, 0, 2, 5, 0, 0, 0, 1]\n",
                 {"camera.yaml:7: T_BS: expected a rotation"});
  expect_refused(head + "T_BS: [0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 3, 4, 5, 1]\n",
                 {"camera.yaml:4: T_BS: expected a last row 0, 0, 0, 1, found 3, 4, 5, 1"});
  expect_refused(head + good + " 0]\n", {"camera.yaml:7: T_BS: expected 16 numbers, found 9"});
}

}  // namespace
}  // namespace stemvo
