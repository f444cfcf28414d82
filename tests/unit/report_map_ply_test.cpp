// SPDX-License-Identifier: MIT
#include "report/data_files.hpp"
#include "support/ply_reader.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

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

TEST(MapPly, EmptyIsAFileTooAndAWrongFolderIsAnError) {
  const TempFolder folder;
  ASSERT_TRUE(write_map_ply(folder / "map.ply", {}, {}));
  EXPECT_TRUE(read_ply(folder / "map.ply").vertices.empty());
  EXPECT_THAT(message_of(write_map_ply("/nonexistent/map.ply", {}, {})),
              HasSubstr("/nonexistent/map.ply: cannot write"));
}

}  // namespace
}  // namespace stemvo
