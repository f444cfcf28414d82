// SPDX-License-Identifier: MIT
#include "mapping/map_keeper.hpp"
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

}  // namespace
}  // namespace stemvo
