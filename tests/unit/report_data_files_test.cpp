// SPDX-License-Identifier: MIT
#include <clocale>
#include <locale>

#include "evaluation/trajectory.hpp"
#include "report/data_files.hpp"
#include "support/ply_reader.hpp"
#include "support/run_program.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

constexpr char kHeader[] =
    "frame,timestamp_s,state,matches,inliers,s_h,s_f,r_h,model,stem_ms,features_ms,pose_ms,"
    "scale_sigma,scale_state,fx_px,cx_px,cy_px,fx_sigma_px,cx_sigma_px,cy_sigma_px,"
    "recognized_frame,map_scale,map_x,map_y,map_z,map_qx,map_qy,map_qz,map_qw,"
    "map_id,is_scale_new,x,y,z,qx,qy,qz,qw,"
    "step_var_x,step_var_y,step_var_z,step_var_rx,step_var_ry,step_var_rz,error_m,error_deg\n";

const Rigid3 kPose = {Eigen::Quaterniond(0.8, 0.0, 0.0, 0.6), {1.0, 2.0, -0.5}};

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
  result.motion_covariance.diagonal() << 0.01, 0.02, 0.03, 0.04, 0.05, 1.2345678e-6;
  result.map_from_world = {1.25, Eigen::Quaterniond(0.8, 0.6, 0.0, 0.0), {0.5, -1.0, 1.0 / 3.0}};
  return result;
}

TEST(FramesCsv, HoldsOneRowPerFrame) {
  EXPECT_EQ(kFramesCsvHeader, kHeader);
  EXPECT_EQ(frames_csv_row(100, 10.3622, FrameResult(), Rigid3()) +
                frames_csv_row(101, 10.466, tracked(), kPose),
            "100,10.3622,first,0,0,0.000,0.000,0.0000,none,0.000,0.000,0.000,,disabled,0.00,0."
            "00,0.00,,,,,1,0,0,0,0,0,0,1,0,0,"
            "0,0,0,0,0,0,1,0,0,0,0,0,0,,\n"
            "101,10.466,tracking,812,640,1234.568,4321.000,0.2222,essential,"
            "1.250,12.500,3.000,0.0123,held,700.00,600.50,180.25,3.50,0.50,0.75,"
            "12,1.25,0.5,-1,0.333333333,0.6,0,0,0.8,2,1,"
            "1,2,-0.5,0,0,0.6,0.8,0.01,0.02,0.03,0.04,0.05,1.23457e-06,,\n");
}

TEST(FramesCsv, ErrorsStandInTheRowsThatHaveATruth) {
  const std::string row = frames_csv_row(7, 0.5, tracked(), kPose);
  const FrameError errors[] = {{1, 0.25, 1.0 / 3.0}};
  const std::string filled = row.substr(0, row.size() - 3) + ",0.2500,0.3333\n";
  EXPECT_EQ(frames_csv_with_errors(kHeader + row + row + row, errors),
            kHeader + row + filled + row);
}

TEST(FramesCsv, EveryColumnIsOnItsPageInOrder) {
  const std::string page = read_file(fs::path(STEMVO_SOURCE_DIR) / "docs/results.md");
  const std::string table = page.substr(page.find("## frames.csv"));
  std::string found;
  for (std::size_t at = table.find("\n| `"); at != std::string::npos;) {
    for (std::size_t word = at + 4; table[word - 1] == '`'; word = table.find('`', word) + 4) {
      found += table.substr(word, table.find('`', word) - word) + ",";
      if (table.compare(table.find('`', word), 4, "`, `") != 0) {
        break;
      }
    }
    at = table.find("\n| `", at + 1);
  }
  found.back() = '\n';
  EXPECT_EQ(found, kHeader);
}

/// A number format with a decimal comma and dots between thousands.
struct CommaNumbers : std::numpunct<char> {
  [[nodiscard]] char do_decimal_point() const override { return ','; }
  [[nodiscard]] char do_thousands_sep() const override { return '.'; }
  [[nodiscard]] std::string do_grouping() const override { return "\3"; }
};

TEST(FramesCsv, DoesNotFollowTheLocale) {
  const std::locale before = std::locale::global(std::locale(std::locale(), new CommaNumbers));
  const std::string row = frames_csv_row(1234567, 1.5, tracked(), kPose);
  std::locale::global(before);
  EXPECT_THAT(row, StartsWith("1234567,1.5,tracking,812,640,1234.568,"));
}

TEST(MapPly, ReadsBackAsItWasGiven) {
  const TempFolder folder;
  const std::vector<ColoredPoint> points{{{1.5F, -2.25F, 30.125F}, {10, 0, 255}},
                                         {{-4.0F, 0.0F, 1e-3F}, {200, 13, 10}}};
  Trajectory path(3);
  path[1].translation = {0.1, 0.0, 1.0};
  path[2].translation = {0.3, -0.1, 2.0};
  ASSERT_TRUE(write_map_ply(folder / "map.ply", points, path));
  const PlyFile file = read_ply(folder / "map.ply");
  ASSERT_EQ(file.vertices.size(), 5U);
  for (std::size_t i = 0; i < points.size(); ++i) {
    EXPECT_EQ(file.vertices[i].position, points[i].position);
    EXPECT_EQ(file.vertices[i].rgb, points[i].rgb);
  }
  for (std::size_t i = 0; i < path.size(); ++i) {
    EXPECT_EQ(file.vertices[2 + i].position, path[i].translation.cast<float>());
    EXPECT_EQ(file.vertices[2 + i].rgb, kMapPathColor);
  }
  using Edges = std::vector<std::array<std::int32_t, 2>>;
  EXPECT_EQ(file.edges, (Edges{{2, 3}, {3, 4}}));
}

TEST(MapPly, HeaderIsTheOneThatViewersExpect) {
  const TempFolder folder;
  ASSERT_TRUE(write_map_ply(folder / "map.ply", std::vector<ColoredPoint>(1), Trajectory(1)));
  const std::string bytes = read_all(folder / "map.ply");
  EXPECT_THAT(bytes, StartsWith("ply\nformat binary_little_endian 1.0\n"));
  EXPECT_THAT(bytes, HasSubstr("element vertex 2\nproperty float x\nproperty float y\n"
                               "property float z\nproperty uchar red\nproperty uchar green\n"
                               "property uchar blue\nelement edge 0\n"
                               "property int vertex1\nproperty int vertex2\n"));
}

TEST(MapPly, LeavesOutWhatIsNoNumber) {
  const TempFolder folder;
  std::vector<ColoredPoint> points(2);
  points[0].position.y() = std::numeric_limits<float>::quiet_NaN();
  ASSERT_TRUE(write_map_ply(folder / "map.ply", points, Trajectory(3)));
  const PlyFile file = read_ply(folder / "map.ply");
  EXPECT_EQ(file.vertices.size(), 4U);
  EXPECT_EQ(file.edges.size(), 2U);
}

}  // namespace
}  // namespace stemvo
