// SPDX-License-Identifier: MIT
#include "geometry/median.hpp"
#include "geometry/pose_influence.hpp"
#include "geometry/pose_refinement.hpp"
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

}  // namespace
}  // namespace stemvo
