// SPDX-License-Identifier: MIT
#include "geometry/median.hpp"
#include "geometry/pose_influence.hpp"
#include "geometry/pose_refinement.hpp"
#include "geometry/residuals.hpp"
#include "geometry/two_view_models.hpp"
#include "support/matchers.hpp"
#include "support/motion_errors.hpp"
#include "support/synthetic_drive_tracks.hpp"
#include "support/synthetic_scene.hpp"
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

constexpr double kLoss_px = 0.3;
constexpr int kTrials = 200;

Rigid3 found_pose(const Scene& scene, const std::vector<Eigen::Vector2d>& uv) {
  return refine_absolute_pose(scene.cur_from_prev, scene.points_in_prev, uv, scene.camera,
                              {.loss_scale_px = kLoss_px});
}

/// Scenes of one kind, each with noise of its own; median of what `of_scene` says of each.
template <typename Square>
double median_of_trials(double noise_px, double outlier_ratio, const Square& of_scene) {
  std::vector<double> squares;
  for (int i = 0; i < kTrials; ++i) {
    squares.push_back(of_scene(make_scene({.num_points = 150,
                                           .noise_px = noise_px,
                                           .outlier_ratio = outlier_ratio,
                                           .seed = static_cast<std::uint64_t>(i)})));
  }
  return median(squares);
}

TEST(PoseInfluence, TheirSquaresAreTheCovarianceWhateverTheNoise) {
  for (const double noise_px : {0.05, 0.2, 0.3}) {
    const double found = median_of_trials(noise_px, 0.05, [&](const Scene& scene) {
      const Rigid3 pose = found_pose(scene, scene.cur_uv);
      const PoseInfluences influences =
          pose_influences(pose, scene.points_in_prev, scene.cur_uv, scene.camera, kLoss_px);
      // True = (error) pose: an error in the camera's axes, before the pose.
      return squared_error(pose.inverse(), scene.cur_from_prev.inverse(),
                           influences.squared_sum()) /
             5.35;  // chi squared's median
    });
    EXPECT_GT(found, 0.8) << noise_px;
    EXPECT_LT(found, 1.4) << noise_px;
  }
}

TEST(PoseInfluence, OfAPointIsWhatThePoseIsWithoutIt) {
  Scene scene = make_scene({.num_points = 80, .noise_px = 0.1, .seed = 4});
  // A point at arm's length holds the pose nearly alone.
  const Eigen::Vector3d near(0.1, 0.05, 0.3);
  scene.points_in_prev.push_back(scene.cur_from_prev.inverse() * near);
  scene.cur_uv.push_back(scene.camera.project(near) + Eigen::Vector2d(0.2, -0.1));
  const Rigid3 pose = found_pose(scene, scene.cur_uv);
  const Vector6d influence =
      pose_influences(pose, scene.points_in_prev, scene.cur_uv, scene.camera, kLoss_px)
          .of_point.back();
  scene.points_in_prev.pop_back();
  scene.cur_uv.pop_back();
  const Rigid3 without = found_pose(scene, scene.cur_uv);
  const Rigid3 change = without * pose.inverse();
  Vector6d expected;
  expected << change.translation, so3_log(change.rotation);
  EXPECT_LT((influence - expected).norm(), 0.2 * expected.norm());
}

TEST(PoseInfluence, TwoViewsSayHowSureTheirMotionIs) {
  for (const double noise_px : {0.05, 0.1}) {
    const double found = median_of_trials(noise_px, 0.0, [&](const Scene& scene) {
      const PixelPairs pairs(scene.prev_uv, scene.cur_uv);
      const Rigid3 motion = refine_relative_pose(scene.cur_from_prev, pairs, scene.camera,
                                                 {.loss_scale_px = kLoss_px})
                                .cur_from_prev;
      Matrix6d covariance = relative_pose_covariance(motion, pairs, scene.camera, kLoss_px);
      covariance.diagonal() += Vector6d::Constant(1e-12);  // of the length, which is known
      return squared_error(motion.inverse(), scene.cur_from_prev.inverse(), covariance) / 4.35;
    });
    EXPECT_GT(found, 0.75) << noise_px;
    EXPECT_LT(found, 1.35) << noise_px;
  }
}

/// The truth turned by rotation_rad and with its direction turned by direction_rad.
Rigid3 disturbed(const Scene& scene, double rotation_rad, double direction_rad) {
  SceneRandom random(77);
  const Eigen::Vector3d& t = scene.cur_from_prev.translation;
  const Eigen::Vector3d axis = t.cross(random.direction()).normalized();
  return {so3_exp(rotation_rad * random.direction()) * scene.cur_from_prev.rotation,
          so3_exp(direction_rad * axis) * t};
}

RefinedMotion refine(const Scene& scene, const Rigid3& start) {
  return refine_relative_pose(start, {scene.prev_uv, scene.cur_uv}, scene.camera);
}

TEST(RefineRelativePose, ExactMatchesGiveTheExactMotion) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    Camera camera = kitti_camera();
    camera.fy_px *= seed % 2 == 0 ? 0.7 : 1.0;
    const Scene scene = make_scene({.camera = camera, .seed = seed});
    const RefinedMotion result = refine(scene, disturbed(scene, 0.02, 0.1));
    EXPECT_LE(rotation_error_rad(result.cur_from_prev, scene.cur_from_prev), 1e-6) << seed;
    EXPECT_LE(
        direction_error_rad(result.cur_from_prev.translation, scene.cur_from_prev.translation),
        1e-6)
        << seed;
    EXPECT_LE(result.cost, 1e-9);
  }
}

struct MedianErrors {
  double rotation_rad = 0.0;
  double direction_rad = 0.0;
};

MedianErrors median_errors(SceneOptions options) {
  std::vector<double> rotation;
  std::vector<double> direction;
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    options.seed = seed;
    const Scene scene = make_scene(options);
    const Rigid3 found = refine(scene, disturbed(scene, 0.005, 0.05)).cur_from_prev;
    rotation.push_back(rotation_error_rad(found, scene.cur_from_prev));
    direction.push_back(direction_error_rad(found.translation, scene.cur_from_prev.translation));
  }
  return {median(rotation), median(direction)};
}

TEST(RefineRelativePose, NoiseIsAveragedOut) {
  const MedianErrors errors = median_errors({.num_points = 500, .noise_px = 0.3});
  EXPECT_LE(errors.rotation_rad, 3e-4);
  EXPECT_LE(errors.direction_rad, 2e-3);
  // A tenth of the noise, about a tenth of the error.
  const MedianErrors small = median_errors({.num_points = 500, .noise_px = 0.03});
  EXPECT_LE(small.rotation_rad, 3e-5);
  EXPECT_LE(small.direction_rad, 2e-4);
}

TEST(RefineRelativePose, CostNeverRises) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    const Scene scene =
        make_scene({.num_points = 60, .noise_px = 1.0, .outlier_ratio = 0.5, .seed = seed});
    for (const double start_error : {0.0, 0.01, 0.3, 2.0}) {
      const Rigid3 start = disturbed(scene, start_error, start_error);
      double last_cost = std::numeric_limits<double>::infinity();
      for (const int max_iterations : {0, 1, 20}) {
        const RefinedMotion result = refine_relative_pose(
            start, {scene.prev_uv, scene.cur_uv}, scene.camera, {.max_iterations = max_iterations});
        EXPECT_TRUE(std::isfinite(result.cost));
        EXPECT_LE(result.cost, last_cost);
        last_cost = result.cost;
        EXPECT_NEAR(result.cur_from_prev.translation.norm(), 1.0, 1e-12);
        EXPECT_NEAR(result.cur_from_prev.rotation.norm(), 1.0, 1e-12);
      }
      // The reported cost is that of the reported motion.
      const RefinedMotion result = refine(scene, start);
      const RefinedMotion same = refine_relative_pose(
          result.cur_from_prev, {scene.prev_uv, scene.cur_uv}, scene.camera, {.max_iterations = 0});
      EXPECT_NEAR(same.cost, result.cost, 1e-9 * (1.0 + result.cost));
    }
  }
}

TEST(RefineRelativePose, CostIsTheRobustSampsonDistanceInPixels) {
  // So many wrong matches that the product of the loss's terms needs several logarithms.
  const Scene scene =
      make_scene({.num_points = 400, .noise_px = 1.0, .outlier_ratio = 0.5, .seed = 4});
  Camera camera = scene.camera;
  camera.fy_px = 500.0;
  const Eigen::Matrix3d f =
      fundamental_from_essential(essential_from_motion(scene.cur_from_prev), camera);
  double expected = 0.0;
  for (std::size_t i = 0; i < scene.prev_uv.size(); ++i) {
    const Eigen::Vector3d in_cur = f * scene.prev_uv[i].homogeneous();
    const Eigen::Vector3d in_prev = f.transpose() * scene.cur_uv[i].homogeneous();
    const double residual = in_cur.dot(scene.cur_uv[i].homogeneous());
    const double squared =
        residual * residual / (in_cur.head<2>().squaredNorm() + in_prev.head<2>().squaredNorm());
    expected += 0.7 * 0.7 * std::log1p(squared / (0.7 * 0.7));
  }
  const RefinedMotion result =
      refine_relative_pose(scene.cur_from_prev, {scene.prev_uv, scene.cur_uv}, camera,
                           {.loss_scale_px = 0.7, .max_iterations = 0});
  EXPECT_NEAR(result.cost, expected, 1e-9 * expected);
}

TEST(RefineRotation, NoiseAndOutliers) {
  const Rigid3 turn(so3_exp({0.02, -0.06, 0.01}), Eigen::Vector3d::Zero());
  std::vector<double> errors;
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    const Scene scene = make_scene({.num_points = 500,
                                    .noise_px = 0.3,
                                    .outlier_ratio = 0.2,
                                    .seed = seed,
                                    .cur_from_prev = turn});
    const Eigen::Quaterniond found = refine_rotation(so3_exp({0.0, 0.01, 0.0}) * turn.rotation,
                                                     {scene.prev_uv, scene.cur_uv}, scene.camera);
    errors.push_back(found.angularDistance(turn.rotation));
  }
  EXPECT_LE(median(errors), 1.5e-4);
}

TEST(SampsonTerm, DerivativesAgreeWithNumericOnes) {
  Camera camera = kitti_camera();
  camera.fy_px = 500.0;  // to catch a factor that is missing on one axis
  const Eigen::Vector3d squared_inverse_focal(std::pow(camera.fx_px, -2),
                                              std::pow(camera.fy_px, -2), 0.0);
  const Scene scene =
      make_scene({.num_points = 50, .noise_px = 2.0, .outlier_ratio = 0.2, .seed = 4});
  for (std::size_t i = 0; i < scene.prev_uv.size(); ++i) {
    const auto term_at = [&](const Eigen::Vector3d& turn, const Eigen::Vector3d& shift) {
      const Eigen::Quaterniond rotation = so3_exp(turn) * scene.cur_from_prev.rotation;
      return internal::sampson_term(rotation.toRotationMatrix(),
                                    scene.cur_from_prev.translation + shift, squared_inverse_focal,
                                    camera.normalize(scene.prev_uv[i]).homogeneous(),
                                    camera.normalize(scene.cur_uv[i]).homogeneous());
    };
    const Eigen::Vector3d none = Eigen::Vector3d::Zero();
    Eigen::Vector3d by_rotation;
    Eigen::Vector3d by_translation;
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d h = 1e-6 * Eigen::Vector3d::Unit(k);
      by_rotation[k] = (term_at(h, none).residual_px - term_at(-h, none).residual_px) / 2e-6;
      by_translation[k] = (term_at(none, h).residual_px - term_at(none, -h).residual_px) / 2e-6;
    }
    const internal::SampsonTerm term = term_at(none, none);
    const double tolerance = 1e-6 * (1.0 + std::hypot(by_rotation.norm(), by_translation.norm()));
    EXPECT_THAT(term.by_rotation, IsNear(by_rotation, tolerance)) << "match " << i;
    EXPECT_THAT(term.by_translation, IsNear(by_translation, tolerance)) << "match " << i;
  }
}

}  // namespace
}  // namespace stemvo
