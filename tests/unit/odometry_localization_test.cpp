// SPDX-License-Identifier: MIT
#include "odometry/localization.hpp"
#include "odometry/robust_models.hpp"
#include "support/synthetic_scene.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

/// Landmarks of a street, seen from a known place.
struct Seen {
  Camera camera = kitti_camera();
  Rigid3 world_from_camera{so3_exp({0.02, 0.4, -0.01}), {3.0, -0.2, 8.0}};
  SeenLandmarks landmarks;

  Seen(int count, double noise_px, double wrong_share) {
    SceneRandom random(3);
    while (landmarks.size() < count) {
      const Eigen::Vector2d uv = random.pixel(camera);
      const Eigen::Vector3d x = random.uniform(4.0, 50.0) * camera.normalize(uv).homogeneous();
      const bool is_wrong = random.uniform(0.0, 1.0) < wrong_share;
      const Eigen::Vector2d noise = random.noise(noise_px);
      landmarks.points.push_back(world_from_camera * x);
      landmarks.uv.push_back(is_wrong ? random.pixel(camera) : Eigen::Vector2d(uv + noise));
    }
  }
  [[nodiscard]] std::optional<Localization> from(const Rigid3& predicted) const {
    return localize(landmarks, predicted, camera, {});
  }
  void expect_found(const std::optional<Localization>& found, double max_m) const {
    ASSERT_TRUE(found.has_value());
    EXPECT_LT((found->world_from_camera.translation - world_from_camera.translation).norm(), max_m);
    EXPECT_LT(found->world_from_camera.rotation.angularDistance(world_from_camera.rotation), 1e-3);
  }
};

TEST(Localization, FromAPredictionThatIsNear) {
  const Seen seen(300, 0.2, 0.2);
  const Rigid3 near = seen.world_from_camera * Rigid3(so3_exp({0.0, 0.01, 0.0}), {0.0, 0.1, 0.3});
  const auto found = seen.from(near);
  seen.expect_found(found, 0.02);
  EXPECT_GT(found->num_inliers, 220);
  EXPECT_LT(found->num_inliers, 260);
}

TEST(Localization, APredictionThatIsWrongIsNoObstacle) {
  const Seen seen(300, 0.2, 0.2);
  seen.expect_found(seen.from(Rigid3()), 0.02);
  const Rigid3 behind = seen.world_from_camera * Rigid3(so3_exp({0.0, 2.0, 0.0}), {0.0, 0.0, 90.0});
  seen.expect_found(seen.from(behind), 0.02);
}

TEST(Localization, TheNearerOfTwoPredictionsIsKnownByTheLandmarks) {
  const Seen seen(300, 0.2, 0.2);
  const Rigid3 near = seen.world_from_camera * Rigid3(so3_exp({0.0, 0.05, 0.0}), {0.0, 0.1, 0.3});
  const Rigid3 far = seen.world_from_camera * Rigid3(so3_exp({0.0, -0.5, 0.1}), {0.0, 0.1, 0.3});
  const auto nearer = [&](const Rigid3& a, const Rigid3& b) {
    return nearer_pose(a, b, seen.landmarks, seen.camera).matrix();
  };
  EXPECT_EQ(nearer(near, far), near.matrix());
  EXPECT_EQ(nearer(far, near), near.matrix());
  EXPECT_EQ(nearer_pose(far, near, {}, seen.camera).matrix(), far.matrix());
}

TEST(Localization, MostLandmarksMayBeWrong) {
  const Seen seen(300, 0.2, 0.6);
  seen.expect_found(seen.from(Rigid3()), 0.05);
}

TEST(Localization, TooFewOrContradictingLandmarksGiveNoPose) {
  const Seen few(LocalizationOptions{}.min_landmarks - 1, 0.0, 0.0);
  EXPECT_FALSE(few.from(few.world_from_camera).has_value());
  const Seen wrong(300, 0.0, 1.0);
  EXPECT_FALSE(wrong.from(wrong.world_from_camera).has_value());
  EXPECT_FALSE(localize({}, Rigid3(), few.camera, {}).has_value());
}

TEST(Localization, SeesTheLandmarksThatTheFrameTracks) {
  Window window;
  window.landmarks = {{2, {0.0, 0.0, 2.0}}, {5, {0.0, 0.0, 5.0}}, {9, {0.0, 0.0, 9.0}}};
  const Observations points{{1, {1.0, 0.0}}, {5, {5.0, 0.0}}, {7, {7.0, 0.0}}, {9, {9.0, 0.0}}};
  const SeenLandmarks seen = find_seen_landmarks(window, points);
  ASSERT_EQ(seen.size(), 2);
  EXPECT_EQ(seen.points[0].z(), 5.0);
  EXPECT_EQ(seen.uv[1].x(), 9.0);
}

TEST(Localization, LostLandmarksAreThoseInFrontThatTheFrameDoesNotTrack) {
  const Camera camera{100.0, 100.0, 50.0, 40.0, 100, 80};
  Window window;
  window.landmarks = {
      {2, {0.0, 0.0, 2.0}}, {5, {0.0, 0.0, 5.0}}, {6, {1.0, 0.0, -5.0}}, {9, {1.0, 2.0, 9.0}}};
  const Rigid3 world_from_camera(Eigen::Quaterniond::Identity(), {0.0, 0.0, -1.0});
  const Observations lost =
      project_lost_landmarks(window, world_from_camera, {{5, {50.0, 40.0}}}, camera);
  ASSERT_EQ(lost.size(), 2U);
  EXPECT_EQ(lost[0].track_id, 2);
  EXPECT_EQ(lost[1].track_id, 9);
  EXPECT_LT((lost[1].uv - Eigen::Vector2d(60.0, 60.0)).norm(), 1e-9);
}

constexpr double kBound_px = 4.0;

/// Landmarks that a camera sees `way` after it stood at `held`.
struct Moved {
  Camera camera = kitti_camera();
  Rigid3 held{so3_exp({0.02, 0.4, -0.01}), {3.0, -0.2, 8.0}};
  Rigid3 world_from_camera;
  SeenLandmarks seen;

  Moved(const Rigid3& way, double min_depth_m, double noise_px, int count = 200)
      : world_from_camera(held * way) {
    SceneRandom random(5);
    for (int i = 0; i < count; ++i) {
      const Eigen::Vector2d uv = random.pixel(camera);
      const double depth_m = random.uniform(min_depth_m, 2.0 * min_depth_m);
      seen.points.push_back(world_from_camera * (depth_m * camera.normalize(uv).homogeneous()));
      seen.uv.push_back(uv + random.noise(noise_px));
    }
  }
  [[nodiscard]] std::optional<double> parallax_px() const {
    return parallax_since_px(held.translation, world_from_camera, seen, camera, kBound_px);
  }
};

TEST(ParallaxSince, ATurnOnTheSpotHasNone) {
  // The pose found is a little off, as noise makes it.
  Moved turn({so3_exp({0.0, 5.0 * kDeg, 0.0}), Eigen::Vector3d::Zero()}, 10.0, 0.2);
  turn.world_from_camera =
      turn.world_from_camera * Rigid3(so3_exp({0.0, 1e-4, 0.0}), {0.003, 0.0, 0.003});
  ASSERT_TRUE(turn.parallax_px().has_value());
  EXPECT_LT(*turn.parallax_px(), 0.45);
}

TEST(ParallaxSince, AStepThatMovesTheImageHas) {
  const Rigid3 aside(so3_exp({0.0, 5.0 * kDeg, 0.0}), {0.05, 0.0, 0.0});
  // A shift to the side looks like a turn but for the differences in depth: 718 px * 0.05 m / Z.
  EXPECT_GT(Moved(aside, 10.0, 0.2).parallax_px().value(), 0.45);
  EXPECT_LT(Moved(aside, 100.0, 0.2).parallax_px().value(), 0.45);
  const Rigid3 ahead(Eigen::Quaterniond::Identity(), {0.0, 0.0, 0.5});
  EXPECT_GT(Moved(ahead, 10.0, 0.2).parallax_px().value(), 0.45);
}

TEST(ParallaxSince, FewLandmarksTellNothingAndFarOnesAreLeftOut) {
  const Rigid3 none;
  EXPECT_TRUE(Moved(none, 10.0, 0.2, 10).parallax_px().has_value());
  EXPECT_FALSE(Moved(none, 10.0, 0.2, 9).parallax_px().has_value());
  Moved wrong(none, 10.0, 0.2, 10);
  wrong.seen.uv.front().x() += 2.0 * kBound_px;
  EXPECT_FALSE(wrong.parallax_px().has_value());
}

struct PoseScene {
  Scene scene;
  Rigid3 camera_from_world;
  std::vector<Eigen::Vector3d> points_in_world;
};

/// A camera somewhere far from the origin that sees 150 points.
PoseScene pose_scene(double noise_px, double outlier_ratio, std::uint64_t seed) {
  SceneOptions options{
      .num_points = 150, .noise_px = noise_px, .outlier_ratio = outlier_ratio, .seed = seed};
  PoseScene result{make_scene(options), {}, {}};
  const Rigid3 world_from_prev(so3_exp({0.2, 2.5, -0.1}), {1200.0, -30.0, 2500.0});
  result.camera_from_world = result.scene.cur_from_prev * world_from_prev.inverse();
  for (const Eigen::Vector3d& point : result.scene.points_in_prev) {
    result.points_in_world.push_back(world_from_prev * point);
  }
  return result;
}

TEST(RobustPose, FindsThePoseWithoutAGuessAmongWrongMatchesAndTheSameBitsAgain) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const PoseScene s = pose_scene(0.3, 0.6, seed);
    const auto pose =
        estimate_absolute_pose(s.points_in_world, s.scene.cur_uv, s.scene.camera, 2.0, 1);
    ASSERT_TRUE(pose.has_value()) << seed;
    const Rigid3 error = *pose * s.camera_from_world.inverse();
    EXPECT_LT(error.angle_rad(), 5e-3) << seed;
    EXPECT_LT(error.translation.norm(), 0.05) << seed;
    const auto again =
        estimate_absolute_pose(s.points_in_world, s.scene.cur_uv, s.scene.camera, 2.0, 1);
    ASSERT_TRUE(again.has_value());
    EXPECT_EQ(again->translation, pose->translation);
    EXPECT_EQ(again->rotation.coeffs(), pose->rotation.coeffs());
  }
}

TEST(RobustPose, TooLittleOrDegenerateInputIsNoCrash) {
  const Scene scene = make_scene({});
  const std::vector<Eigen::Vector3d> few(5, Eigen::Vector3d(1.0, 2.0, 9.0));
  const std::vector<Eigen::Vector2d> few_uv(5, Eigen::Vector2d(100.0, 80.0));
  EXPECT_FALSE(estimate_absolute_pose(few, few_uv, scene.camera, 2.0, 1).has_value());
  const std::vector<Eigen::Vector3d> same(50, Eigen::Vector3d(1.0, 2.0, 9.0));
  const std::vector<Eigen::Vector2d> same_uv(50, Eigen::Vector2d(100.0, 80.0));
  const auto pose = estimate_absolute_pose(same, same_uv, scene.camera, 2.0, 1);
  EXPECT_TRUE(!pose.has_value() || pose->matrix().allFinite());
}

}  // namespace
}  // namespace stemvo
