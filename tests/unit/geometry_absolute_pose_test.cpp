// SPDX-License-Identifier: MIT
#include "geometry/pose_refinement.hpp"
#include "support/synthetic_drive_tracks.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

struct Correspondences {
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector2d> uv;
};

Correspondences seen_from(const DriveTracks& drive, std::size_t frame) {
  Correspondences result;
  for (const auto& [id, uv] : drive.observations[frame]) {
    result.points.push_back(drive.points[static_cast<std::size_t>(id)]);
    result.uv.push_back(uv);
  }
  return result;
}

const Rigid3 kPush(so3_exp({0.01, -0.02, 0.01}), {0.3, -0.2, 0.5});

TEST(AbsolutePose, ExactDataAreReproduced) {
  const DriveTracks drive(4, 0.0, 1);
  const Correspondences seen = seen_from(drive, 3);
  const Rigid3 truth = drive.world_from_camera[3].inverse();
  const Rigid3 pose = refine_absolute_pose(kPush * truth, seen.points, seen.uv, drive.camera);
  EXPECT_LE(pose.rotation.angularDistance(truth.rotation), 1e-8);
  EXPECT_LE((pose.translation - truth.translation).norm(), 1e-7);
}

TEST(AbsolutePose, AThirdOfWrongPointsDoesNotPull) {
  const DriveTracks drive(4, 0.2, 2);
  Correspondences seen = seen_from(drive, 3);
  for (std::size_t i = 0; i < seen.uv.size(); i += 3) {
    seen.uv[i] += Eigen::Vector2d(30.0, -20.0);
  }
  seen.points[4] = Eigen::Vector3d(0.0, 0.0, -50.0);
  const Rigid3 truth = drive.world_from_camera[3].inverse();
  const Rigid3 pose = refine_absolute_pose(kPush * truth, seen.points, seen.uv, drive.camera);
  EXPECT_LE(pose.rotation.angularDistance(truth.rotation), 5e-4);
  EXPECT_LE((pose.translation - truth.translation).norm(), 0.02);
}

TEST(AbsolutePose, TooFewPointsGiveTheStartBack) {
  const DriveTracks drive(2, 0.0, 3);
  const Rigid3 pose = refine_absolute_pose(kPush, {}, {}, drive.camera);
  EXPECT_EQ(pose.translation, kPush.translation);
}

}  // namespace
}  // namespace stemvo
