// SPDX-License-Identifier: MIT
#include "mapping/map_file.hpp"
#include "support/small_map.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

constexpr std::size_t kHeaderBytes = 34;  // magic, version, number of bytes, checksum
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

class MapFiles : public ::testing::Test {
 protected:
  [[nodiscard]] std::string bytes_of(const MapFile& map) const {
    EXPECT_TRUE(write_map_file(folder_ / "written", map));
    return read_all(folder_ / "written");
  }
  /// Why a file of these bytes is refused.
  [[nodiscard]] std::string refusal(const std::string& bytes) const {
    return message_of(read_map_file(folder_.file("read", bytes)));
  }

  TempFolder folder_;
};

TEST_F(MapFiles, ComeBackToTheLastBit) {
  const std::string bytes = bytes_of(small_map());
  const auto read = read_map_file(folder_ / "written");
  EXPECT_EQ(read->channel, "default");
  const KeptMap& map = read->map;
  ASSERT_EQ(map.keyframes.size(), 2U);
  EXPECT_EQ(map.keyframes[1].frame, 5);
  EXPECT_EQ(map.keyframes[1].time_s, 0.5);
  EXPECT_EQ(map.keyframes[1].world_from_camera.translation.z(), 1.0 / 3.0);
  EXPECT_EQ(map.keyframes[1].camera.fy_px, 101.0);
  EXPECT_EQ(map.keyframes[0].corners[0].in_camera, Eigen::Vector3f(0.25F, -0.5F, 4.0F));
  EXPECT_FALSE(map.keyframes[0].corners[1].has_landmark());
  EXPECT_EQ(map.keyframes[0].descriptors[0][3], 0xffffffffffffffffU);
  EXPECT_EQ(map.map_from_keyframe[1].scale, 1.25);
  EXPECT_EQ(map.motions[0].sigma_translation, 2e-3);
  EXPECT_EQ(map.loops[0].corners, (std::vector<std::pair<int, int>>{{0, 1}}));
  EXPECT_EQ(map.lengths[0].sigma, 0.05);
  EXPECT_EQ(bytes_of(*read), bytes);
}

TEST_F(MapFiles, OfNoKeyframesAreRead) { EXPECT_EQ(refusal(bytes_of({})), "no error"); }

TEST_F(MapFiles, CutAnywhereAreRefused) {
  const std::string bytes = bytes_of(small_map());
  for (std::size_t size = 0; size < bytes.size(); size += 7) {
    EXPECT_THAT(refusal(bytes.substr(0, size)), StartsWith((folder_ / "read").string() + ": "));
  }
  EXPECT_THAT(refusal(bytes + "x"), HasSubstr("the map is cut or damaged"));
}

TEST_F(MapFiles, DamagedAnywhereAreRefused) {
  const std::string bytes = bytes_of(small_map());
  for (std::size_t i = 0; i < bytes.size(); i += 7) {
    std::string damaged = bytes;
    damaged[i] = static_cast<char>(damaged[i] ^ 0x10);
    EXPECT_NE(refusal(damaged), "no error") << "byte " << i;
  }
}

TEST_F(MapFiles, SayWhatTheyAreInstead) {
  EXPECT_THAT(refusal("ply\nformat ascii"), HasSubstr("expected a map of stemvo, found another"));
  std::string other = bytes_of(small_map());
  other[14] = 9;
  EXPECT_THAT(refusal(other), HasSubstr("expected a map of version 2, found version 9"));
  EXPECT_THAT(message_of(read_map_file(folder_ / "nothing")), HasSubstr("nothing: cannot read"));
}

/// Each of the contents' bytes in turn claims a list as long as can be.
TEST_F(MapFiles, TakeNoListsWordForItsLength) {
  const std::string contents = bytes_of(small_map()).substr(kHeaderBytes);
  const auto claims_at = [&](std::size_t i) {
    return sealed_map(std::string(contents).replace(i, 8, 8, '\x7f'));
  };
  for (std::size_t i = 0; i + 8 <= contents.size(); i += 4) {
    (void)refusal(claims_at(i));  // no more memory than the file
  }
  EXPECT_THAT(refusal(claims_at(0)), HasSubstr("the map is damaged"));
  EXPECT_THAT(refusal(sealed_map(contents + "12")), HasSubstr("the map is damaged"));
}

TEST_F(MapFiles, ThatContradictThemselvesAreRefused) {
  const std::vector<std::function<void(KeptMap&)>> cases = {
      [](auto& m) { m.map_from_keyframe.pop_back(); },
      [](auto& m) { m.keyframes[1].frame = 0; },
      [](auto& m) { m.keyframes[1].frame = std::numeric_limits<int>::max(); },
      [](auto& m) { m.keyframes[1].time_s = kNaN; },
      [](auto& m) { m.keyframes[0].camera.fx_px = 0.0; },
      [](auto& m) { m.keyframes[0].world_from_camera.rotation.w() = 1.1; },
      [](auto& m) { m.keyframes[0].corners[0].in_camera.y() = static_cast<float>(kNaN); },
      [](auto& m) { m.keyframes[0].corners[0].track_id = 8; },
      [](auto& m) { m.keyframes[0].descriptors.pop_back(); },
      [](auto& m) { m.map_from_keyframe[1].scale = 0.0; },
      [](auto& m) { m.motions[0].to = 2; },
      [](auto& m) { m.motions[0].from = -1; },
      [](auto& m) { m.motions[0].from = 1; },
      [](auto& m) { m.motions[0].from_to.scale = kNaN; },
      [](auto& m) { m.motions[0].sigma_log_scale = kNaN; },
      [](auto& m) { m.motions[0].sigma_rad = 0.0; },
      [](auto& m) { m.loops[0].corners[0].second = 2; },
      [](auto& m) { m.loops[0].corners[0].first = -1; },
      [](auto& m) { m.loops[0].to = 7; },
      [](auto& m) { m.lengths[0].keyframe = 2; },
      [](auto& m) { m.lengths[0].sigma = 0.0; },
  };
  for (std::size_t i = 0; i < cases.size(); ++i) {
    MapFile spoilt = small_map();
    cases[i](spoilt.map);
    EXPECT_THAT(refusal(bytes_of(spoilt)), HasSubstr("contradict each other")) << "case " << i;
  }
}

}  // namespace
}  // namespace stemvo
