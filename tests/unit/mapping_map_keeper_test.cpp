// SPDX-License-Identifier: MIT
#include "mapping/map_keeper.hpp"
#include "mapping/pose_graph.hpp"
#include "support/small_map.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

TEST(MapKeeper, PutsAnotherRecordingsFramesTimesAndTracksBeforeItsOwn) {
  MapKeeper keeper;
  for (int i = 0; i < 2; ++i) {
    keeper.load(i == 0 ? small_map().map : keeper.map());
    const KeptMap& map = keeper.map();
    EXPECT_EQ(map.keyframes[0].frame, -7);
    EXPECT_EQ(map.keyframes[1].frame, -2) << "-1 is none";
    EXPECT_LT(map.keyframes[1].time_s, -100.0);
    EXPECT_EQ(map.keyframes[1].time_s - map.keyframes[0].time_s, 0.5);
    EXPECT_EQ(map.keyframes[0].corners[0].track_id, -6);
    EXPECT_EQ(map.keyframes[0].corners[1].track_id, -2);
    EXPECT_EQ(map.loops.size(), 1U);
  }
  EXPECT_FALSE(keeper.has_own(0));
  EXPECT_EQ(keeper.map_from_world().scale, 1.0) << "it is not known where the world lies in it";
}

/// A camera that goes forward; each window has two keyframes and landmarks of its own.
class MapKeeperWindows : public ::testing::Test {
 protected:
  /// A window of two keyframes is opened, localizes frames up to the last one, and is dropped.
  void pass(int first, int second, int last, int first_track) {
    Window window;
    for (const int frame : {first, second}) {
      Keyframe& keyframe = window.keyframes.emplace_back();
      keyframe.frame = frame;
      keyframe.world_from_camera.translation.z() = frame;
      for (int i = 0; i < 20; ++i) {
        const Eigen::Vector3d point(i % 5 - 2.0, i / 5 - 1.5, 30.0 + i);
        window.landmarks[first_track + i] = point;
        const Eigen::Vector2d noise(i % 2 == 0 ? 0.1 : -0.1, 0.0);
        const Eigen::Vector3d in_camera = keyframe.world_from_camera.inverse() * point;
        keyframe.points.push_back({first_track + i, camera_.project(in_camera) + noise});
      }
    }
    for (int frame = static_cast<int>(trajectory_.size()); frame <= last; ++frame) {
      times_s_.push_back(0.1 * frame);
      trajectory_.emplace_back().translation.z() = frame;
    }
    history_.observe(window, image_);
    history_.end_frame(window);
    WindowView view{window, history_, camera_, radials_, trajectory_, times_s_, 0.01, last};
    keeper_.add_nodes(view);
    keeper_.close(view);
    history_.close(window);
  }
  /// Whether a loop from the first keyframe to the last one joins two maps.
  bool are_two_maps() {
    Loop loop;
    loop.to = static_cast<int>(keeper_.map().keyframes.size()) - 1;
    return keeper_.add_loop(loop).has_value();
  }

  const Camera camera_{300.0, 300.0, 160.0, 120.0, 320, 240};
  const std::vector<Eigen::Vector2d> radials_{1000, Eigen::Vector2d::Zero()};
  const cv::Mat image_{240, 320, CV_8UC1, cv::Scalar(0)};
  std::vector<Rigid3> trajectory_;
  std::vector<double> times_s_;
  WindowHistory history_;
  MapKeeper keeper_;
};

TEST_F(MapKeeperWindows, ThatBeginAtTheLastKeyframeGoOnInTheirOwnUnit) {
  pass(0, 3, 3, 0);
  pass(3, 6, 6, 10);
  const KeptMap& map = keeper_.map();
  ASSERT_EQ(map.keyframes.size(), 3U);
  EXPECT_EQ(map.keyframes[1].frame, 3);
  ASSERT_EQ(map.keyframes[1].corners.size(), 30U);
  EXPECT_FALSE(map.keyframes[1].corners[0].has_landmark()) << "it is in the old unit";
  EXPECT_TRUE(map.keyframes[1].corners[29].has_landmark());
  ASSERT_EQ(map.motions.size(), 2U);
  EXPECT_LT(map.motions[0].sigma_rad, 0.01);
  EXPECT_LT(map.motions[1].sigma_log_scale, 0.1);
  EXPECT_GE(map.motions[0].sigma_log_scale, 1.0);
  for (const MapLength& length : map.lengths) {
    EXPECT_NE(length.keyframe, 1);
  }
  EXPECT_FALSE(are_two_maps());
}

TEST_F(MapKeeperWindows, ThatBeginWhereTheLastOneSawGoOn) {
  pass(0, 3, 5, 0);
  pass(5, 8, 8, 10);
  const MapEdge& edge = keeper_.map().motions[1];
  EXPECT_LT(edge.sigma_rad, 0.01);
  EXPECT_GE(edge.sigma_log_scale, 1.0);
  EXPECT_FALSE(are_two_maps());
}

TEST_F(MapKeeperWindows, ThatBeginBehindAreMapsOfTheirOwn) {
  pass(0, 3, 4, 0);
  pass(5, 8, 8, 10);
  EXPECT_GE(keeper_.map().motions[1].sigma_rad, 1.0);
  EXPECT_TRUE(are_two_maps());
}

TEST(MapKeeper, PiecesOfAMapThatNothingConnectsStayPieces) {
  KeptMap map = small_map().map;
  map.loops.clear();
  MapKeeper whole;
  whole.load(map);
  EXPECT_EQ(whole.component_of(0), whole.component_of(1));
  map.motions[0].sigma_rad = 1.0;  // a guess
  MapKeeper pieces;
  pieces.load(map);
  EXPECT_NE(pieces.component_of(0), pieces.component_of(1));
}

constexpr int kPerRound = 30;
constexpr int kRounds = 4;
constexpr int kPlaceEvery = 3;

/// A camera that goes around in a room, as it is and as the map has it: each third keyframe is a
/// place in the first round, and shows that one in the others, in other units.
struct Room {
  Room() {
    for (int i = 0; i < kRounds * kPerRound; ++i) {
      const Eigen::Quaterniond turn = so3_exp({0.0, 2.0 * M_PI * i / kPerRound, 0.1});
      const double units = 1.0 + 0.2 * (i / kPerRound);
      map.map_from_keyframe.emplace_back(1.0 / units, turn, turn * Eigen::Vector3d(0.0, 0.1, 2.0));
      KeptKeyframe keyframe;
      keyframe.frame = 2 * i;
      keyframe.world_from_camera = {turn, units * map.map_from_keyframe.back().translation};
      keyframe.corners.resize(1);
      keyframe.descriptors.resize(i < kPerRound && i % kPlaceEvery == 0 ? 1 : 0);
      map.keyframes.push_back(keyframe);
      if (i > 0) {
        map.motions.push_back({i - 1, i, between(i - 1, i), 1e-3, 5e-3, 6e-3});
      }
      if (i >= kPerRound && i % kPlaceEvery == 0) {
        const MapEdge edge{i % kPerRound, i, between(i % kPerRound, i), 2e-3, 1e-2, 1e-2};
        map.loops.push_back({edge, {{0, 0}}});
      }
      map.lengths.push_back({i, -std::log(units), 0.1});
    }
  }
  [[nodiscard]] Similarity3 between(int from, int to) const {
    return map.map_from_keyframe[static_cast<std::size_t>(from)].inverse() *
           map.map_from_keyframe[static_cast<std::size_t>(to)];
  }
  [[nodiscard]] std::vector<Similarity3> trajectory() const {
    std::vector<Rigid3> world_from_camera;
    std::vector<double> times_s;
    for (int i = 0; i < 2 * kRounds * kPerRound; ++i) {
      const double turn = M_PI * i / kPerRound;
      world_from_camera.emplace_back(so3_exp({0.0, turn, 0.0}), Eigen::Vector3d(turn, 0.0, 0.0));
      times_s.push_back(0.1 * i);
    }
    return place_trajectory(world_from_camera, times_s, map);
  }

  KeptMap map;
};

TEST(MapMerge, ARoomThatIsSeenAgainAddsNothingButWhereTheCameraWas) {
  Room room;
  const auto loops = frames_of_loops(room.map);
  const std::vector<Similarity3> before = room.trajectory();
  const std::vector<int> numbers = merge_known_terrain(room.map, kRounds * kPerRound - 8);
  ASSERT_EQ(numbers.size(), static_cast<std::size_t>(kRounds * kPerRound));
  EXPECT_LT(room.map.keyframes.size(), kPerRound + 14U);
  EXPECT_LT(room.map.motions.size(), kPerRound + 14U);
  EXPECT_LT(room.map.loops.size(), 3U * kPerRound / kPlaceEvery);
  EXPECT_EQ(room.map.keyframes.size() + room.map.merged.size(), numbers.size());
  EXPECT_EQ(room.map.lengths.size(), room.map.keyframes.size());
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    if (numbers[i] >= 0) {
      EXPECT_EQ(room.map.keyframes[static_cast<std::size_t>(numbers[i])].frame,
                2 * static_cast<int>(i));
    }
  }
  EXPECT_EQ(numbers.back(), static_cast<int>(room.map.keyframes.size()) - 1) << "it is in use";
  // The rest says the same.
  for (const MapEdge& motion : room.map.motions) {
    EXPECT_LT(sigmas_off(room.map, motion), 1e-6);
  }
  for (const Loop& loop : room.map.loops) {
    EXPECT_LT(sigmas_off(room.map, loop), 1e-6);
    EXPECT_NE(loop.from, loop.to);
  }
  auto loops_after = frames_of_loops(room.map);
  std::ranges::sort(loops_after, {}, [](const auto& pair) { return pair.second; });
  EXPECT_EQ(loops_after, loops);
  const std::vector<Similarity3> after = room.trajectory();
  for (std::size_t i = 0; i < 2 * numbers.size() - 40; ++i) {
    if (i % (2 * kPerRound) + 1 != 2 * kPerRound) {  // the trajectory jumps to other units there
      EXPECT_LT((after[i].translation - before[i].translation).norm(), 1e-6) << i;
    }
  }
  EXPECT_TRUE(merge_known_terrain(room.map, static_cast<int>(room.map.keyframes.size())).empty())
      << "little is left to merge";
}

TEST(MapMerge, KeepsWhatTheGraphDoesNotAgreeWithAndWhatNothingMeasured) {
  Room contradicted;
  for (Loop& loop : contradicted.map.loops) {
    loop.from_to.translation.x() += 1.0;
  }
  EXPECT_TRUE(merge_known_terrain(contradicted.map, kRounds * kPerRound).empty());
  Room torn;
  for (MapEdge& motion : torn.map.motions) {
    motion.sigma_rad = motion.to >= kPerRound ? 1.0 : motion.sigma_rad;
  }
  EXPECT_TRUE(merge_known_terrain(torn.map, kRounds * kPerRound).empty());
}

TEST(MapMerge, SigmasOfAWayGrowWithItsArm) {
  const Similarity3 step(0.5, so3_exp({0.0, 0.3, 0.0}), {0.0, 0.0, 2.0});
  const MapEdge a{0, 1, step, 0.01, 0.02, 0.03};
  const MapEdge b{1, 2, step, 0.01, 0.02, 0.03};
  const MapEdge both = chained(a, b);
  EXPECT_EQ(both.from, 0);
  EXPECT_EQ(both.to, 2);
  EXPECT_NEAR(both.from_to.scale, 0.25, 1e-12);
  EXPECT_NEAR(both.sigma_rad, std::sqrt(2.0) * 0.01, 1e-12);
  // 0.02, half of 0.02, and an arm of one unit that turns by 0.01 and stretches by 0.03.
  EXPECT_NEAR(both.sigma_translation, std::sqrt(0.0004 + 0.0001 + 0.0001 + 0.0009), 1e-12);
  const MapEdge back = reversed(a);
  EXPECT_LT(((back.from_to * a.from_to).translation).norm(), 1e-12);
  EXPECT_NEAR(back.sigma_translation, std::sqrt(0.0004 + 0.0004 + 0.0036) / 0.5, 1e-12);
}

}  // namespace
}  // namespace stemvo
