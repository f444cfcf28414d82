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

TEST(Localization, FindsThePoseWhateverIsPredictedThoughMostLandmarksAreWrong) {
  const Seen seen(300, 0.2, 0.2);
  const Rigid3 near = seen.world_from_camera * Rigid3(so3_exp({0.0, 0.01, 0.0}), {0.0, 0.1, 0.3});
  const auto found = seen.from(near);
  seen.expect_found(found, 0.02);
  EXPECT_GT(found->num_inliers, 220);
  EXPECT_LT(found->num_inliers, 260);
  const Rigid3 behind = seen.world_from_camera * Rigid3(so3_exp({0.0, 2.0, 0.0}), {0.0, 0.0, 90.0});
  seen.expect_found(seen.from(behind), 0.02);
  seen.expect_found(seen.from(Rigid3()), 0.02);
  const Seen wrong(300, 0.2, 0.6);
  wrong.expect_found(wrong.from(Rigid3()), 0.05);
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

TEST(Localization, TooFewOrContradictingLandmarksGiveNoPose) {
  const Seen few(LocalizationOptions{}.min_landmarks - 1, 0.0, 0.0);
  EXPECT_FALSE(few.from(few.world_from_camera).has_value());
  const Seen wrong(300, 0.0, 1.0);
  EXPECT_FALSE(wrong.from(wrong.world_from_camera).has_value());
  EXPECT_FALSE(localize({}, Rigid3(), few.camera, {}).has_value());
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

TEST(RobustPose, FindsThePoseWithoutAGuessAmongWrongMatchesAndTheSameBitsAgain) {
  const Rigid3 world_from_prev(so3_exp({0.2, 2.5, -0.1}), {1200.0, -30.0, 2500.0});
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const Scene scene =
        make_scene({.num_points = 150, .noise_px = 0.3, .outlier_ratio = 0.6, .seed = seed});
    std::vector<Eigen::Vector3d> points;
    for (const Eigen::Vector3d& point : scene.points_in_prev) {
      points.push_back(world_from_prev * point);
    }
    const auto estimate = [&] {
      return estimate_absolute_pose(points, scene.cur_uv, scene.camera, 2.0, 1).value();
    };
    const Rigid3 pose = estimate();
    const Rigid3 error = pose * world_from_prev * scene.cur_from_prev.inverse();
    EXPECT_LT(error.angle_rad(), 5e-3) << seed;
    EXPECT_LT(error.translation.norm(), 0.05) << seed;
    EXPECT_EQ(estimate().translation, pose.translation);
    EXPECT_EQ(estimate().rotation.coeffs(), pose.rotation.coeffs());
  }
}

}  // namespace
}  // namespace stemvo
