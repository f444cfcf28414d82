// SPDX-License-Identifier: MIT
#include "odometry/motion_covariance.hpp"
#include "odometry/motion_model.hpp"
#include "odometry/pair_estimator.hpp"
#include "odometry/window_estimator.hpp"
#include "support/estimator_run.hpp"
#include "support/motion_errors.hpp"
#include "support/synthetic_scene.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

/// Driving, standing, driving, turning on the spot, driving.
std::vector<Rigid3> eventful_path() {
  const Rigid3 ahead(so3_exp({0.0, 0.005, 0.001}), {0.02, 0.0, 0.8});
  const Rigid3 turn(so3_exp({0.0, 0.02, 0.0}), Eigen::Vector3d::Zero());
  std::vector<Rigid3> path(1);
  for (const auto& [motion, count] :
       {std::pair(ahead, 14), std::pair(Rigid3(), 4), std::pair(ahead, 8), std::pair(turn, 4),
        std::pair(ahead, 10)}) {
    path = DriveTracks::go_on(path, motion, count);
  }
  return path;
}

DriveTracks eventful_drive(double noise_px) {
  const std::vector<Rigid3> path = eventful_path();
  return {path, points_along(path, 1500, 3), noise_px, 3};
}

double sigma_of_length(const FrameResult& result) {
  return std::sqrt(result.motion_covariance.topLeftCorner<3, 3>().trace());
}

void expect_covariances(const std::vector<FrameResult>& results) {
  EXPECT_EQ(results.front().motion_covariance, Matrix6d::Zero());
  for (std::size_t i = 1; i < results.size(); ++i) {
    const Matrix6d& covariance = results[i].motion_covariance;
    EXPECT_TRUE(covariance.allFinite()) << i;
    EXPECT_EQ(covariance, covariance.transpose()) << i;
    EXPECT_EQ(covariance.llt().info(), Eigen::Success) << i << to_string(results[i].state);
  }
}

/// A hand that hardly moves: by the motion model as much as by the images.
TEST(MotionCovariance, IsHonestWhereThereIsHardlyAnyParallax) {
  std::vector<Rigid3> path;
  double x = 0.0;
  for (int i = 0; i < 260; ++i) {
    x += i < 60 ? 0.02 : 0.0015 * std::sin(0.1 * i);
    path.emplace_back(so3_exp({0.0, 0.001 * i, 0.0}), Eigen::Vector3d(x, 0.0, 0.0));
  }
  const DriveTracks drive(path, points_of_room(2500, 4.0, 4), 0.1, 4);
  WindowEstimator estimator(config_without_scale(), drive.camera);
  EstimatorRun run(estimator, drive);
  run.interval_s = 1.0 / 30.0;
  run.add_all();
  const double unit = length_ratio(estimator.trajectory(), path, 20, 59);
  double sum = 0.0;
  int count = 0;
  int inside = 0;
  for (std::size_t i = 65; i < path.size(); ++i) {
    if (run.results[i].state == FrameState::kTracking) {
      continue;
    }
    Rigid3 motion = motion_to(path, i);
    motion.translation *= unit;
    const double squared = squared_error(motion_to(estimator.trajectory(), i), motion,
                                         run.results[i].motion_covariance);
    sum += squared / 6.0;
    inside += squared < 12.592 ? 1 : 0;
    ++count;
  }
  ASSERT_GT(count, 100);
  EXPECT_GT(sum / count, 0.1);
  EXPECT_LT(sum / count, 1.6);
  EXPECT_GT(inside, 0.85 * count);
}

/// Images fail for a quarter of a second while a hand turns to and fro.
TEST(MotionCovariance, IsHonestWhereNothingIsSeenOfATurn) {
  constexpr double kInterval_s = 1.0 / 30.0;
  std::vector<Rigid3> path;
  for (int i = 0; i < 100; ++i) {
    path.emplace_back(so3_exp({0.0, 0.3 * std::sin(6.0 * kInterval_s * i), 0.0}),
                      Eigen::Vector3d(0.02 * i, 0.0, 0.0));
  }
  const DriveTracks drive(path, points_of_room(2500, 4.0, 4), 0.1, 4);
  double worst = 0.0;
  for (int lost_at = 60; lost_at < 90; lost_at += 4) {
    WindowEstimator estimator(config_without_scale(), drive.camera);
    EstimatorRun run(estimator, drive);
    run.interval_s = kInterval_s;
    run.add_range(0, lost_at);
    for (int i = lost_at; i < lost_at + 8; ++i) {
      run.add_missing();
      const Rigid3 error = motion_to(estimator.trajectory(), i).inverse() * motion_to(path, i);
      worst =
          std::max(worst, so3_log(error.rotation).squaredNorm() /
                              run.results[i].motion_covariance.bottomRightCorner<3, 3>().trace());
    }
  }
  EXPECT_LT(worst, 2.5 * 2.5);
  EXPECT_GT(worst, 0.5 * 0.5);
}

TEST(MotionCovariance, IsFiniteAndPositiveDefiniteInEveryState) {
  std::set<FrameState> seen;
  for (const OdometryMode mode : {OdometryMode::kMap, OdometryMode::kTwoFrame}) {
    for (const double noise_px : {0.0, 0.05}) {
      const DriveTracks drive = eventful_drive(noise_px);
      std::unique_ptr<Estimator> estimator;
      if (mode == OdometryMode::kMap) {
        estimator = std::make_unique<WindowEstimator>(config_without_scale(mode), drive.camera);
      } else {
        estimator = std::make_unique<PairEstimator>(config_without_scale(mode), drive.camera);
      }
      EstimatorRun run(*estimator, drive);
      run.add_range(0, 34);
      run.add_missing();
      run.add_missing();
      run.add_range(36, 38);
      run.add_matches({}, 38);
      run.add_range(39, drive.num_frames());
      expect_covariances(run.results);
      for (const FrameResult& result : run.results) {
        seen.insert(result.state);
      }
    }
  }
  for (const FrameState state :
       {FrameState::kFirst, FrameState::kInitializing, FrameState::kTracking,
        FrameState::kStationary, FrameState::kRotating, FrameState::kLost, FrameState::kNoImage}) {
    EXPECT_TRUE(seen.contains(state)) << to_string(state);
  }
}

/// Else a pose that steps lead to would be unsure by the first one for good.
TEST(MotionCovariance, TheStepThatOpensAMapIsAsSureAsTheMap) {
  const DriveTracks drive(20, 0.2, 5);
  WindowEstimator estimator(config_without_scale(), drive.camera);
  EstimatorRun run(estimator, drive);
  run.add_all();
  ASSERT_EQ(run.results[1].state, FrameState::kInitializing);
  ASSERT_EQ(run.results[2].state, FrameState::kTracking);
  Rigid3 motion = motion_to(drive.world_from_camera, 1);
  motion.translation *= length_ratio(estimator.trajectory(), drive.world_from_camera, 2, 19);
  const double length = motion.translation.norm();
  EXPECT_LT(sigma_of_length(run.results[1]), 0.2 * length);
  EXPECT_LT(
      squared_error(motion_to(estimator.trajectory(), 1), motion, run.results[1].motion_covariance),
      12.592);
}

TEST(MotionCovariance, IsZeroUntilAFrameIsSeen) {
  const DriveTracks drive(30, 0.2, 5);
  WindowEstimator window(config_without_scale(), drive.camera);
  PairEstimator pair(config_without_scale(OdometryMode::kTwoFrame), drive.camera);
  for (Estimator* estimator : {static_cast<Estimator*>(&window), static_cast<Estimator*>(&pair)}) {
    EstimatorRun run(*estimator, drive);
    run.add_missing();
    run.add_missing();
    run.add_range(2, 12);
    for (int i = 0; i < 3; ++i) {
      EXPECT_EQ(run.results[i].motion_covariance, Matrix6d::Zero()) << i;
    }
    expect_covariances({run.results.begin() + 2, run.results.end()});
  }
}

TEST(MotionCovariance, GrowsFromFrameToFrameWhileNothingIsSeenAndOnceMoreAfterwards) {
  const DriveTracks drive(30, 0.2, 5);
  Options options = config_without_scale();
  options.camera.refine = CameraRefinement::kOff;
  WindowEstimator estimator(options, drive.camera);
  EstimatorRun run(estimator, drive);
  run.add_range(0, 20);
  const double tracked = sigma_of_length(run.results.back());
  const double first = sigma_of_length(run.add_missing());
  const double second = sigma_of_length(run.add_missing());
  const FrameResult found = run.add(22);
  ASSERT_EQ(found.state, FrameState::kTracking);
  EXPECT_GT(first, tracked);
  EXPECT_GT(second, 1.2 * first);
  EXPECT_GT(sigma_of_length(found), second);
  EXPECT_LT(sigma_of_length(run.add(23)), first);
}

/// A tracked frame's motion that is known but for the term in question.
MotionCovariance::Motion known_motion() {
  return {.state = FrameState::kTracking,
          .is_localized = true,
          .prev_from_cur = {so3_exp({0.0, 0.1, 0.0}), {0.0, 0.0, 2.0}},
          .dt_s = 0.1,
          .usual_step = 2.0,
          .hidden_px = 0.15,
          .two_view = Matrix6d::Zero(),
          .camera = kitti_camera(),
          .camera_sigma = std::nullopt,
          .scale_sigma = std::nullopt};
}

TEST(MotionCovariance, KeepsToTheUnitOfTheMap) {
  MotionCovariance kept;
  MotionCovariance rescaled;
  Vector6d units = Vector6d::Ones();
  for (int i = 0; i < 20; ++i) {
    MotionCovariance::Motion motion = known_motion();
    motion.prev_from_cur.translation.z() += 0.3 * std::sin(i);
    if (i == 19) {  // by the changes of velocity before
      motion.state = FrameState::kLost;
      motion.is_localized = false;
    }
    const Matrix6d expected = kept.finish(motion);
    if (i == 15) {
      units.head<3>().setConstant(3.0);
      rescaled.rescale(3.0);
    }
    motion.prev_from_cur.translation *= units.x();
    motion.usual_step *= units.x();
    const Matrix6d found = rescaled.finish(motion);
    EXPECT_TRUE(found.isApprox(units.asDiagonal() * expected * units.asDiagonal(), 1e-9)) << i;
  }
}

TEST(MotionCovariance, TheScaleStretchesTheStep) {
  MotionCovariance::Motion motion = known_motion();
  motion.scale_sigma = 0.03;
  const Matrix6d covariance = MotionCovariance().finish(motion);
  const Eigen::Vector3d along =
      motion.prev_from_cur.rotation.conjugate() * Eigen::Vector3d::UnitZ();
  const Eigen::Matrix3d of_step = covariance.topLeftCorner<3, 3>();
  EXPECT_NEAR(std::sqrt(along.dot(of_step * along)), 0.06, 1e-4);
  EXPECT_NEAR(of_step.trace(), 0.0036, 1e-5);
}

TEST(MotionCovariance, APrincipalPointThatIsOffTurnsTheStep) {
  MotionCovariance::Motion motion = known_motion();
  motion.prev_from_cur.rotation.setIdentity();
  motion.camera_sigma = CameraSigma{.fx_px = 0.0, .cx_px = 2.0, .cy_px = 0.0};
  const Matrix6d covariance = MotionCovariance().finish(motion);
  EXPECT_NEAR(std::sqrt(covariance(0, 0)), 2.0 * 2.0 / motion.camera.fx_px, 1e-3);
  EXPECT_LT(std::sqrt(covariance(2, 2)), 1e-4);
}

constexpr double kDt_s = 1.0 / 30.0;

Matrix6d noise_of(double units, double rad) {
  Vector6d sigma;
  sigma << Eigen::Vector3d::Constant(units), Eigen::Vector3d::Constant(rad);
  return sigma.cwiseAbs2().asDiagonal();
}

/// A camera's motion that is seen with noise, frame by frame.
struct Followed {
  MotionModel model;
  Rigid3 truth;
  Rigid3 pose;
  SceneRandom random{7};

  void step(const Rigid3& motion, double sigma, double weight) {
    truth = truth * motion;
    const Eigen::Vector2d xy = random.noise(sigma);
    const Rigid3 seen = truth * Rigid3(Eigen::Quaterniond::Identity(), {xy.x(), xy.y(), 0.0});
    const auto fused = model.fuse(pose.inverse() * seen, noise_of(sigma, 1e-4), weight, kDt_s);
    model.measured(fused.prev_from_cur, kDt_s, true);
    pose = pose * fused.prev_from_cur;
  }
  [[nodiscard]] double error() const { return (pose.translation - truth.translation).norm(); }
};

TEST(MotionModel, ACameraThatStandsHasLessNoiseThanItsMeasurements) {
  Followed still;
  double sum = 0.0;
  for (int i = 0; i < 600; ++i) {
    still.step({}, 0.01, 1.0);
    sum += i >= 60 ? still.error() : 0.0;
  }
  EXPECT_LT(sum / 540, 0.007);  // 0.0125 as measured
  EXPECT_LT(still.error(), 0.02);
}

TEST(MotionModel, APushIsFollowed) {
  Followed camera;
  for (int i = 0; i < 120; ++i) {
    camera.step({}, 0.001, 1.0);
  }
  for (int i = 0; i < 30; ++i) {
    camera.step({Eigen::Quaterniond::Identity(), {0.02, 0.0, 0.0}}, 0.001, 1.0);
    EXPECT_LT(camera.error(), 0.012) << i;
  }
  EXPECT_LT(camera.error(), 0.004);
}

// As sure as the measurement: half way, and half the covariance. What the turn shares goes along.
TEST(MotionModel, AHoldCountsByItsSigma) {
  Matrix6d noise = 0.04 * Matrix6d::Identity();
  noise(0, 4) = noise(4, 0) = 0.02;
  const Rigid3 measured(Eigen::Quaterniond::Identity(), {0.1, 0.0, 0.0});
  const MotionModel::Fused fused = MotionModel().fuse(measured, noise, /*weight=*/0.0, 0.1,
                                                      MotionModel::Hold{{0.0, 0.0, 0.0}, 0.2});
  EXPECT_NEAR(fused.prev_from_cur.translation.x(), 0.05, 1e-9);
  EXPECT_NEAR(so3_log(fused.prev_from_cur.rotation).y(), -0.025, 1e-9);
  const Matrix6d covariance = fused.gain * noise * fused.gain.transpose() + fused.rest;
  EXPECT_NEAR(covariance(0, 0), 0.02, 1e-12);
  EXPECT_NEAR(covariance(4, 4), 0.04 - 0.02 * 0.02 / 0.08, 1e-12);
}

TEST(MotionModel, KeepsToTheUnitOfTheMap) {
  MotionModel one;
  MotionModel other;
  Vector6d units = Vector6d::Ones();
  SceneRandom random(3);
  for (int i = 0; i < 60; ++i) {
    if (i == 30) {
      units.head<3>().setConstant(4.0);
      other.rescale(4.0);
    }
    const Eigen::Vector2d xy = random.noise(0.01);
    Rigid3 motion(so3_exp({0.0, 0.001 * xy.y(), 0.0}), {xy.x(), 0.0, 0.02});
    Matrix6d noise = noise_of(0.01, 1e-3);
    const auto found = one.fuse(motion, noise, 0.7, kDt_s);
    motion.translation *= units.x();
    noise = units.asDiagonal() * noise * units.asDiagonal();
    const auto scaled = other.fuse(motion, noise, 0.7, kDt_s);
    EXPECT_LT(
        (scaled.prev_from_cur.translation - units.x() * found.prev_from_cur.translation).norm(),
        1e-9);
    EXPECT_LT(scaled.prev_from_cur.rotation.angularDistance(found.prev_from_cur.rotation), 1e-9);
    one.measured(found.prev_from_cur, kDt_s, true);
    other.measured(scaled.prev_from_cur, kDt_s, true);
  }
}

}  // namespace
}  // namespace stemvo
