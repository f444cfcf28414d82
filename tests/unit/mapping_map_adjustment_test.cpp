// SPDX-License-Identifier: MIT
#include "mapping/map_adjustment.hpp"
#include "support/synthetic_drive_tracks.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

const IntrinsicsDelta kWeak = (IntrinsicsDelta() << 30.0, 30.0, 0.1, 0.1, 0.1).finished();

/// Somebody walks around in a yard, and turns and nods.
DriveTracks walk(int num_frames, double noise_px, std::uint64_t seed) {
  std::vector<Rigid3> path;
  for (int i = 0; i < num_frames; ++i) {
    const double t = 0.25 * i;
    path.emplace_back(
        so3_exp({0.15 * std::sin(1.3 * t), 0.5 * std::sin(0.4 * t), 0.2 * std::sin(t)}),
        Eigen::Vector3d(1.5 * std::sin(0.35 * t), 0.3 * std::sin(t), 0.1 * t));
  }
  SceneRandom random(seed);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 800; ++i) {
    const double x = random.uniform(-12.0, 12.0);
    const double y = random.uniform(-4.0, 4.0);
    points.emplace_back(x, y, random.uniform(4.0, 20.0));
  }
  return {path, points, noise_px, seed, Camera{500.0, 500.0, 320.0, 240.0, 640, 480}};
}

Eigen::Vector2d bend(const Camera& camera,
                     const Eigen::Vector2d& radial,
                     const Eigen::Vector2d& uv) {
  const Eigen::Vector2d xy = camera.normalize(uv);
  const double r_sq = xy.squaredNorm();
  return camera.project((xy * (1.0 + r_sq * (radial[0] + r_sq * radial[1]))).homogeneous());
}

/// The map that a drive of these tracks leaves: every frame a keyframe, seen through a lens, poses
/// off by `push`.
KeptMap map_of(const DriveTracks& drive, const Eigen::Vector2d& radial, double push) {
  KeptMap map;
  SceneRandom random(5);
  for (int i = 0; i < drive.num_frames(); ++i) {
    KeptKeyframe& keyframe = map.keyframes.emplace_back();
    keyframe.frame = i;
    keyframe.camera = drive.camera;
    const Rigid3 off(so3_exp(0.01 * push * random.direction()), 0.05 * push * random.direction());
    keyframe.world_from_camera = i == 0 ? drive.pose(i) : drive.pose(i) * off;
    map.map_from_keyframe.emplace_back(keyframe.world_from_camera);
    for (const auto& [id, uv] : drive.observations[static_cast<std::size_t>(i)]) {
      keyframe.corners.push_back({id, bend(drive.camera, radial, uv).cast<float>()});
    }
    if (i > 0) {
      const auto& at = map.map_from_keyframe;
      map.motions.push_back(
          {i - 1, i, at[static_cast<std::size_t>(i) - 1].inverse() * at.back(), 0.01, 0.05, 0.01});
    }
  }
  return map;
}

/// Where the drive was, in a map whose first keyframe and scale are held: largest error of a
/// position.
double worst_position(const DriveTracks& drive, const MapAdjustment& adjusted) {
  double ours = 0.0;
  double truth = 0.0;
  for (int i = 0; i < drive.num_frames(); ++i) {
    const Eigen::Vector3d& at = adjusted.map_from_keyframe[static_cast<std::size_t>(i)].translation;
    ours += at.dot(at);
    truth += at.dot(drive.pose(i).translation);
  }
  double worst = 0.0;
  for (int i = 0; i < drive.num_frames(); ++i) {
    const Eigen::Vector3d& at = adjusted.map_from_keyframe[static_cast<std::size_t>(i)].translation;
    worst = std::fmax(worst, (truth / ours * at - drive.pose(i).translation).norm());
  }
  return worst;
}

TEST(MapAdjustment, FindsPosesCameraAndDistortion) {
  const DriveTracks drive = walk(40, 0.0, 1);
  KeptMap map = map_of(drive, {-0.1, 0.05}, 1.0);
  Camera given = drive.camera;
  given.fx_px *= 1.1;
  given.fy_px *= 1.1;
  given.cx_px += 5.0;
  given.cy_px -= 4.0;
  for (KeptKeyframe& keyframe : map.keyframes) {
    keyframe.camera = given;
  }
  MapAdjustmentOptions options;
  options.camera = given;
  options.camera_sigma = kWeak;
  const auto adjusted = adjust_map(map, options);
  ASSERT_TRUE(adjusted);
  const IntrinsicsDelta& change = adjusted->camera.change;
  EXPECT_NEAR(change[0], -5.0, 0.05);
  EXPECT_NEAR(change[1], 4.0, 0.05);
  EXPECT_NEAR(given.fx_px * (1.0 + change[2]), 500.0, 0.05);
  EXPECT_NEAR(change[3], -0.1, 1e-3);
  EXPECT_NEAR(change[4], 0.05, 2e-3);
  EXPECT_LE(worst_position(drive, *adjusted), 1e-3);
  EXPECT_LE(adjusted->median_error_px, 1e-2);
  EXPECT_EQ(adjusted->map_from_keyframe.front().translation, drive.pose(0).translation);
  for (const AdjustedLandmark& landmark : adjusted->landmarks) {
    EXPECT_GE(landmark.views.size(), 2U);
  }
}

TEST(MapAdjustment, FindsThePathByPiecesOfTracks) {
  const DriveTracks drive = walk(40, 0.0, 1);
  const KeptMap map = map_of(drive, {0.0, 0.0}, 1.0);
  MapAdjustmentOptions options;
  options.camera = drive.camera;
  options.max_views = 6;
  const auto adjusted = adjust_map(map, options);
  ASSERT_TRUE(adjusted);
  EXPECT_LE(worst_position(drive, *adjusted), 1e-2);
  for (const AdjustedLandmark& landmark : adjusted->landmarks) {
    EXPECT_GE(landmark.views.size(), 3U);
    EXPECT_LE(landmark.views.size(), 6U);
  }
}

}  // namespace
}  // namespace stemvo
