// SPDX-License-Identifier: MIT
#include "mapping/kept_map.hpp"
#include "support/matchers.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

/// A camera that goes forward one unit and turns a little with each frame, a tenth of a second.
struct Path {
  explicit Path(int num_frames) {
    const Rigid3 step(so3_exp({0.0, 0.01, 0.0}), {0.0, 0.0, 1.0});
    for (int i = 0; i < num_frames; ++i) {
      poses.push_back(i > 0 ? poses.back() * step : Rigid3());
      times_s.push_back(100.0 + 0.1 * i);
    }
  }
  /// The frame is a keyframe, which the map moves by the correction.
  void keep(int frame, const Similarity3& map_from_world) {
    const auto i = static_cast<std::size_t>(frame);
    KeptKeyframe keyframe;
    keyframe.frame = frame;
    keyframe.time_s = times_s[i];
    keyframe.world_from_camera = poses[i];
    if (!map.keyframes.empty()) {
      const int to = static_cast<int>(map.keyframes.size());
      const Rigid3 motion = map.keyframes.back().world_from_camera.inverse() * poses[i];
      map.motions.push_back({to - 1, to, Similarity3(motion), 1e-3, 0.01, 0.01});
    }
    map.keyframes.push_back(keyframe);
    map.map_from_keyframe.push_back(map_from_world * Similarity3(poses[i]));
  }
  [[nodiscard]] std::vector<Similarity3> placed() const {
    return place_trajectory(poses, times_s, map);
  }

  std::vector<Rigid3> poses;
  std::vector<double> times_s;
  KeptMap map;
};

Rigid3 pose_of(const Similarity3& placed) { return {placed.rotation, placed.translation}; }

const Similarity3 kCorrection(1.2, so3_exp({0.05, -0.1, 0.02}), {3.0, -1.0, 2.0});

TEST(MapTrajectory, MovesAllFramesAsOneCorrectionDoes) {
  Path path(40);
  for (const int frame : {5, 12, 30}) {
    path.keep(frame, kCorrection);
  }
  const auto placed = path.placed();
  for (std::size_t i = 0; i < placed.size(); ++i) {
    EXPECT_THAT(pose_of(placed[i]), IsNearMotion(kCorrection * path.poses[i], 1e-10));
    EXPECT_NEAR(placed[i].scale, 1.2, 1e-12);
  }
}

TEST(MapTrajectory, GoesFromOneCorrectionToTheNextByTime) {
  Path path(31);
  path.keep(10, {});
  path.keep(20, {1.44, Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero()});
  path.times_s[12] = 100.0 + 0.1 * 15.0;  // half-way in time
  const auto placed = path.placed();
  EXPECT_THAT(pose_of(placed[4]), IsNearMotion(path.poses[4], 1e-10));
  EXPECT_THAT(pose_of(placed[10]), IsNearMotion(path.poses[10], 1e-10));
  EXPECT_NEAR(placed[12].scale, 1.2, 1e-9);
  EXPECT_THAT(placed[20].translation, IsNear(1.44 * path.poses[20].translation, 1e-9));
  EXPECT_THAT(placed[30].translation, IsNear(1.44 * path.poses[30].translation, 1e-9));
}

/// A place is recognized at frame 20, and the world is moved: the frames before are of the old one.
TEST(MapTrajectory, FollowsTheWorldWhereItIsMoved) {
  Path path(31);
  const Path straight = path;
  path.keep(10, {});
  path.keep(20, {});
  const Rigid3 moved(so3_exp({0.0, 0.3, 0.0}), {5.0, 0.0, -2.0});
  for (std::size_t i = 20; i < path.poses.size(); ++i) {
    path.poses[i] = moved * path.poses[i];
  }
  path.map.keyframes[1].world_from_camera = path.poses[20];
  const auto placed = path.placed();
  for (std::size_t i = 0; i < placed.size(); ++i) {
    EXPECT_THAT(pose_of(placed[i]), IsNearMotion(straight.poses[i], 1e-10)) << i;
  }
  path.map.motions.clear();  // lost in between
  EXPECT_THAT(pose_of(path.placed()[19]), IsNearMotion(straight.poses[19], 1e-10));
}

TEST(MapTrajectory, LeavesKeyframesOfAnotherRecordingAlone) {
  Path path(20);
  path.keep(0, {50.0, Eigen::Quaterniond::Identity(), {7.0, 8.0, 9.0}});
  path.map.keyframes[0].frame = -4;
  const auto alone = path.placed();
  EXPECT_THAT(pose_of(alone[9]), IsNearMotion(path.poses[9], 1e-12));
  path.keep(10, kCorrection);
  const auto placed = path.placed();
  EXPECT_THAT(pose_of(placed[9]), IsNearMotion(kCorrection * path.poses[9], 1e-10));
}

}  // namespace
}  // namespace stemvo
