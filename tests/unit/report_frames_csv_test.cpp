// SPDX-License-Identifier: MIT
#include <clocale>
#include <locale>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "report/frames_csv.hpp"

namespace stemvo {
namespace {

using ::testing::StartsWith;

constexpr char kHeader[] =
    "frame,timestamp_s,state,matches,inliers,s_h,s_f,r_h,model,stem_ms,features_ms,pose_ms,"
    "scale_sigma,scale_state,fx_px,cx_px,cy_px,fx_sigma_px,cx_sigma_px,cy_sigma_px,"
    "recognized_frame,map_scale,map_x,map_y,map_z,map_qx,map_qy,map_qz,map_qw,"
    "map_id,is_scale_new\n";

FrameResult tracked() {
  FrameResult result;
  result.state = FrameState::kTracking;
  result.num_matches = 812;
  result.num_inliers = 640;
  result.homography_score = 1234.5678;
  result.fundamental_score = 4321.0;
  result.homography_ratio = 0.22221;
  result.model = TwoViewModel::kEssential;
  result.scale_state = ScaleState::kHeld;
  result.scale_sigma = 0.01234;
  result.camera = {700.0, 710.0, 600.5, 180.25, 1241, 376};
  result.camera_sigma = {3.5, 0.5, 0.75};
  result.times = {1.25, 12.5, 3.0004};
  result.recognized_frame = 12;
  result.map_id = 2;
  result.is_scale_new = true;
  result.map_from_world = {1.25, Eigen::Quaterniond(0.8, 0.6, 0.0, 0.0), {0.5, -1.0, 1.0 / 3.0}};
  return result;
}

TEST(FramesCsv, HoldsOneRowPerFrame) {
  EXPECT_EQ(frames_csv_header(), kHeader);
  EXPECT_EQ(frames_csv_row(100, 10.3622, FrameResult()) + frames_csv_row(101, 10.466, tracked()),
            "100,10.3622,first,0,0,0.000,0.000,0.0000,none,0.000,0.000,0.000,,disabled,0.00,0."
            "00,0.00,,,,,1,0,0,0,0,0,0,1,0,0\n"
            "101,10.466,tracking,812,640,1234.568,4321.000,0.2222,essential,"
            "1.250,12.500,3.000,0.0123,held,700.00,600.50,180.25,3.50,0.50,0.75,"
            "12,1.25,0.5,-1,0.333333333,0.6,0,0,0.8,2,1\n");
}

/// A number format with a decimal comma and dots between thousands.
struct CommaNumbers : std::numpunct<char> {
  [[nodiscard]] char do_decimal_point() const override { return ','; }
  [[nodiscard]] char do_thousands_sep() const override { return '.'; }
  [[nodiscard]] std::string do_grouping() const override { return "\3"; }
};

TEST(FramesCsv, DoesNotFollowTheLocale) {
  const std::locale before = std::locale::global(std::locale(std::locale(), new CommaNumbers));
  const std::string row = frames_csv_row(1234567, 1.5, tracked());
  std::locale::global(before);
  EXPECT_THAT(row, StartsWith("1234567,1.5,tracking,812,640,1234.568,"));
}

}  // namespace
}  // namespace stemvo
