// SPDX-License-Identifier: MIT
#include "dataset/kitti_text.hpp"
#include "support/test.hpp"
#include "text/text_file.hpp"

namespace stemvo {
namespace {

const std::string kText =
    "P0: 700 0 600 0 0 700 180 0 0 0 1 0\n"
    "P1: 700 0 600 -350 0 700 180 0 0 0 1 0\n"
    "P2: 700 0 600 44.8 0 700 180 0.1 0 0 1 0.004\n"
    "P3: 650 0 610 -300 0 650 190 0 0 0 1 0\n"
    "Tr: 1 0 0 0 0 1 0 0 0 0 1 0\n";
const Camera kGiven{700.0, 700.0, 600.0, 180.0, 1241, 376};
const Camera kRefined{707.0, 707.0, 603.0, 178.0, 1241, 376};

TEST(KittiCamera, RowsOfTheSameCameraChangeAndTheReaderTakesThem) {
  const TempFolder folder;
  const auto text =
      dataset::replace_kitti_camera(folder.file("calib.txt", kText), kGiven, kRefined);
  ASSERT_TRUE(text.has_value()) << text.error().message;
  const auto file = folder.file("refined.txt", *text);
  for (int i = 0; i < 4; ++i) {
    const auto camera = dataset::read_kitti_camera(file, i);
    ASSERT_TRUE(camera.has_value()) << camera.error().message;
    EXPECT_NEAR(camera->fx_px, i == 3 ? 650.0 : 707.0, 1e-9) << i;
    EXPECT_NEAR(camera->cx_px, i == 3 ? 610.0 : 603.0, 1e-9) << i;
    EXPECT_NEAR(camera->cy_px, i == 3 ? 190.0 : 178.0, 1e-9) << i;
  }
  EXPECT_THAT(*text, HasSubstr("P3: 650 0 610 -300 0 650 190 0 0 0 1 0\n"));
  EXPECT_THAT(*text, HasSubstr("\nTr: 1 0 0 0 0 1 0 0 0 0 1 0\n"));
}

TEST(KittiCamera, BaselinesStay) {
  const TempFolder folder;
  const auto text =
      dataset::replace_kitti_camera(folder.file("calib.txt", kText), kGiven, kRefined);
  ASSERT_TRUE(text.has_value());
  // P1: half a metre to the side; P2: K^-1 (44.8, 0.1, 0.004).
  EXPECT_THAT(*text, HasSubstr("-3.535000000000e+02"));
  const Eigen::Vector3d offset(44.8 - 600.0 * 0.004, 0.1 - 180.0 * 0.004, 0.004 * 700.0);
  const double expected = 707.0 * offset.x() / 700.0 + 603.0 * 0.004;
  const std::size_t at = text->find("P2:");
  ASSERT_NE(at, std::string::npos);
  double values[12];
  const int read =
      std::sscanf(text->c_str() + at, "P2: %lf %lf %lf %lf %lf %lf %lf %lf %lf %lf %lf %lf", values,
                  values + 1, values + 2, values + 3, values + 4, values + 5, values + 6,
                  values + 7, values + 8, values + 9, values + 10, values + 11);
  ASSERT_EQ(read, 12);
  EXPECT_NEAR(values[3], expected, 1e-9);
  EXPECT_NEAR(values[7], 707.0 * offset.y() / 700.0 + 178.0 * 0.004, 1e-9);
  EXPECT_NEAR(values[11], 0.004, 1e-12);
}

TEST(KittiCamera, UnchangedCameraGivesTheSameNumbers) {
  const TempFolder folder;
  const auto file = folder.file("calib.txt", kText);
  const auto text = dataset::replace_kitti_camera(file, kGiven, kGiven);
  ASSERT_TRUE(text.has_value());
  EXPECT_THAT(*text, HasSubstr("P1: 7.000000000000e+02 0.000000000000e+00 6.000000000000e+02 "
                               "-3.500000000000e+02"));
}

}  // namespace
}  // namespace stemvo
