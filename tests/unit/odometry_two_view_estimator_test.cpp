// SPDX-License-Identifier: MIT
#include "geometry/median.hpp"
#include "odometry/two_view_estimator.hpp"
#include "stemvo/two_view.hpp"
#include "support/synthetic_scene.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

/// A car's scene: metres, points 5 to 40 m away.
Scene drive_scene(const Rigid3& prev_from_cur,
                  double noise_px,
                  double outliers,
                  std::uint64_t seed) {
  return make_scene({.num_points = 600,
                     .noise_px = noise_px,
                     .outlier_ratio = outliers,
                     .seed = seed,
                     .min_depth = 5.0,
                     .max_depth = 40.0,
                     .cur_from_prev = prev_from_cur.inverse()});
}

MeasuredMotion measure(const Scene& scene, bool is_initializing = false) {
  const TwoViewEstimator estimator(Options{});
  return estimator.measure({scene.prev_uv, scene.cur_uv}, scene.camera, is_initializing);
}

TEST(TwoViewEstimator, ThePublicFunctionFindsTheMotionFromMatchesAlone) {
  const Rigid3 prev_from_cur(so3_exp({0.002, 0.03, -0.001}), {0.05, 0.01, 1.0});
  const Scene scene = drive_scene(prev_from_cur, 0.3, 0.3, 5);
  const auto motion = estimate_two_view(scene.prev_uv, scene.cur_uv, scene.camera);
  ASSERT_EQ(motion->state, FrameState::kTracking);
  EXPECT_EQ(motion->model, TwoViewModel::kEssential);
  EXPECT_LT(motion->homography_ratio, 0.4);
  EXPECT_TRUE(motion->is_decisive);
  EXPECT_EQ(motion->inlier_mask.size(), scene.prev_uv.size());
  const Rigid3 estimate = motion->cur_from_prev.inverse();
  EXPECT_LE(estimate.rotation.angularDistance(prev_from_cur.rotation), 1e-3);
  EXPECT_LE((estimate.translation - prev_from_cur.translation.normalized()).norm(), 0.02);
}

TEST(TwoViewEstimator, ThePublicFunctionSaysWhatIsWrongWithItsInput) {
  const Scene scene = drive_scene({Eigen::Quaterniond::Identity(), {0.0, 0.0, 1.0}}, 0.0, 0.0, 3);
  const auto problem = [&](std::vector<Eigen::Vector2d> prev_uv, const Camera& camera) {
    const auto motion = estimate_two_view(prev_uv, scene.cur_uv, camera);
    return motion ? std::string() : motion.error().message;
  };
  EXPECT_EQ(problem({}, scene.camera),
            "matches: expected as many points in one image as in the other, found 0 and 600");
  std::vector<Eigen::Vector2d> broken = scene.prev_uv;
  broken[7].x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(problem(broken, scene.camera).find("expected finite pixels, found (nan"),
            std::string::npos);
  EXPECT_NE(problem(scene.prev_uv, Camera{}).find("camera: expected a size"), std::string::npos);
  Options options;
  options.two_view.sigma_px = -1.0;
  EXPECT_FALSE(estimate_two_view(scene.prev_uv, scene.cur_uv, scene.camera, options));
  const auto none = estimate_two_view({}, {}, scene.camera).value();
  EXPECT_EQ(none.state, FrameState::kLost);
}

TEST(TwoViewEstimator, NoiseAndOutliersOver50Seeds) {
  const Rigid3 prev_from_cur(so3_exp({0.002, 0.03, -0.001}), {0.05, 0.01, 1.0});
  std::vector<double> rotation_errors_rad;
  std::vector<double> direction_errors_rad;
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    const MeasuredMotion motion = measure(drive_scene(prev_from_cur, 0.3, 0.3, seed));
    ASSERT_EQ(motion.state, FrameState::kTracking) << "seed " << seed;
    const Rigid3 estimate = motion.cur_from_prev.inverse();
    rotation_errors_rad.push_back(estimate.rotation.angularDistance(prev_from_cur.rotation));
    direction_errors_rad.push_back(
        (estimate.translation - prev_from_cur.translation.normalized()).norm());
  }
  EXPECT_LE(median(rotation_errors_rad), 5e-4);
  EXPECT_LE(median(direction_errors_rad), 1e-2);
}

TEST(TwoViewEstimator, InitialModelFollowsTheScene) {
  SceneOptions options{
      .num_points = 500,
      .noise_px = 0.3,
      .planar = true,
      .cur_from_prev = Rigid3(so3_exp({0.0, 0.02, 0.0}), {0.8, 0.1, -0.6}).inverse()};
  int num_right = 0;
  for (options.seed = 1; options.seed <= 20; ++options.seed) {
    const MeasuredMotion planar = measure(make_scene(options), /*is_initializing=*/true);
    EXPECT_GT(planar.homography_ratio, 0.40) << "seed " << options.seed;
    EXPECT_EQ(planar.model, TwoViewModel::kHomography) << "seed " << options.seed;
    const double error_rad =
        planar.cur_from_prev.rotation.angularDistance(options.cur_from_prev->rotation);
    num_right += error_rad < 0.01 ? 1 : 0;
  }
  EXPECT_GE(num_right, 15);  // a plane leaves two motions; the smaller turn is mostly the true one
  options.planar = false;
  const MeasuredMotion general = measure(make_scene(options), /*is_initializing=*/true);
  EXPECT_EQ(general.model, TwoViewModel::kEssential);
  EXPECT_LT(general.homography_ratio, 0.40);
}

TEST(TwoViewEstimator, StationaryRotatingAndLowParallaxAreStates) {
  const MeasuredMotion stationary = measure(drive_scene({}, 0.05, 0.05, 5));
  EXPECT_EQ(stationary.state, FrameState::kStationary);
  EXPECT_EQ(stationary.cur_from_prev.translation.norm(), 0.0);

  const Rigid3 turn(so3_exp({0.0, 0.02, 0.0}), Eigen::Vector3d::Zero());
  const MeasuredMotion rotating = measure(drive_scene(turn, 0.05, 0.05, 6));
  EXPECT_EQ(rotating.state, FrameState::kRotating);
  EXPECT_LE(rotating.cur_from_prev.inverse().rotation.angularDistance(turn.rotation), 2e-4);
  EXPECT_EQ(rotating.cur_from_prev.translation.norm(), 0.0);

  // Noise beyond stationary_flow_px does not make a turn a drive.
  const MeasuredMotion noisy = measure(drive_scene(turn, 0.15, 0.05, 6));
  EXPECT_GT(noisy.parallax_px, OdometryOptions{}.stationary_flow_px);
  EXPECT_EQ(noisy.state, FrameState::kRotating);
  EXPECT_LE(noisy.cur_from_prev.inverse().rotation.angularDistance(turn.rotation), 5e-4);

  const Rigid3 creep(so3_exp({0.0, 0.01, 0.0}), {0.0, 0.0, 0.02});
  const MeasuredMotion low_parallax = measure(drive_scene(creep, 0.05, 0.05, 7));
  EXPECT_EQ(low_parallax.state, FrameState::kLowParallax);
  EXPECT_LE(low_parallax.cur_from_prev.inverse().rotation.angularDistance(creep.rotation), 5e-4);
}

TEST(TwoViewEstimator, TooFewOrRandomMatchesAreLostNotWrong) {
  const Scene scene = drive_scene({{1.0, 0.0, 0.0, 0.0}, {0.0, 0.0, 1.0}}, 0.2, 0.0, 8);
  const TwoViewEstimator estimator(Options{});
  const auto few = std::span(scene.prev_uv).first(5);
  EXPECT_EQ(estimator.measure({few, std::span(scene.cur_uv).first(5)}, scene.camera, false).state,
            FrameState::kLost);
  EXPECT_EQ(estimator.measure({{}, {}}, scene.camera, true).state, FrameState::kLost);

  const MeasuredMotion random = measure(drive_scene({}, 0.0, 1.0, 9));
  EXPECT_TRUE(random.cur_from_prev.translation.allFinite());

  const std::vector<Eigen::Vector2d> same(100, Eigen::Vector2d(10.0, 20.0));
  const std::vector<Eigen::Vector2d> moved(100, Eigen::Vector2d(15.0, 20.0));
  EXPECT_TRUE(
      estimator.measure({same, moved}, scene.camera, true).cur_from_prev.translation.allFinite());
}

}  // namespace
}  // namespace stemvo
