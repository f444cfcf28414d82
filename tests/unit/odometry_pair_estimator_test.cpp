// SPDX-License-Identifier: MIT
#include "odometry/pair_estimator.hpp"
#include "support/estimator_run.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

/// A measured motion from prev_from_cur (what the car did), as the estimator reports it.
MeasuredMotion driven(const Eigen::Vector3d& direction,
                      double yaw_deg,
                      FrameState state = FrameState::kTracking) {
  MeasuredMotion motion;
  motion.state = state;
  motion.cur_from_prev = Rigid3(so3_exp({0.0, yaw_deg * kDeg, 0.0}), direction).inverse();
  motion.parallax_px = 5.0;
  motion.is_decisive = true;
  return motion;
}

/// Frames come every tenth of a second, or as they say.
class Chain : public MotionChain {
 public:
  Chain(const OdometryOptions& options, const ScaleOptions& scale) : MotionChain(options, scale) {
    advance_to(time_s_);
  }
  FrameState add(const MeasuredMotion& motion, double interval_s = 0.1) {
    advance_to(time_s_ += interval_s);
    return MotionChain::add(motion);
  }
  void add_missing(double interval_s = 0.1) {
    advance_to(time_s_ += interval_s);
    extrapolate(/*has_image=*/false);
  }

 private:
  double time_s_ = 5.0;
};

Chain make_chain(const OdometryOptions& options = {}, double step_m = 1.0) {
  ScaleOptions scale{.source = ScaleSource::kConstantSpeed, .step_m = step_m};
  return {options, scale};
}

TEST(MotionChain, TheRightOrderReproducesTheDriveAndThePapersDoesNot) {
  OdometryOptions paper{.composition = Composition::kPaper};
  Chain right = make_chain();
  Chain wrong = make_chain(paper);
  Rigid3 truth;
  for (int i = 0; i < 36; ++i) {  // a right turn over a road that rolls
    const Eigen::Vector3d turn(0.01, 10.0 * kDeg, 0.05 * std::sin(0.5 * i));
    const Rigid3 prev_from_cur(so3_exp(turn), Eigen::Vector3d(0.1, 0.05, 1.0).normalized());
    truth = truth * prev_from_cur;
    MeasuredMotion motion = driven(Eigen::Vector3d::UnitZ(), 0.0);
    motion.cur_from_prev = prev_from_cur.inverse();
    right.add(motion);
    wrong.add(motion);
  }
  EXPECT_LT((right.world_from_camera().translation - truth.translation).norm(), 1e-9);
  EXPECT_LT(right.world_from_camera().rotation.angularDistance(truth.rotation), 1e-9);
  EXPECT_GT((wrong.world_from_camera().translation - truth.translation).norm(), 0.1);
}

TEST(MotionChain, InitializesUntilAMotionIsDecisiveAndGoesByConstantSteps) {
  Chain chain = make_chain({}, 0.7);
  MeasuredMotion doubtful = driven(Eigen::Vector3d::UnitZ(), 0.0);
  doubtful.is_decisive = false;
  EXPECT_EQ(chain.add(doubtful), FrameState::kInitializing);
  EXPECT_TRUE(chain.is_initializing());
  EXPECT_EQ(chain.add(driven(Eigen::Vector3d::UnitZ(), 0.0)), FrameState::kInitializing);
  EXPECT_FALSE(chain.is_initializing());
  EXPECT_EQ(chain.add(driven(Eigen::Vector3d::UnitZ(), 0.0)), FrameState::kTracking);
  EXPECT_NEAR(chain.world_from_camera().translation.z(), 2.1, 1e-12);
}

TEST(MotionChain, ThePapersGateDropsTranslationAndRotation) {
  Chain chain = make_chain({.gate = ForwardGate::kPaper});
  chain.add(driven(Eigen::Vector3d::UnitZ(), 0.0));
  EXPECT_EQ(chain.add(driven(Eigen::Vector3d::UnitX(), 5.0)), FrameState::kGated);
  EXPECT_NEAR(chain.world_from_camera().angle_rad(), 0.0, 1e-12);
  EXPECT_NEAR(chain.world_from_camera().translation.z(), 1.0, 1e-12);
}

TEST(MotionChain, LowParallaxKeepsTheDirectionAndStationaryStays) {
  Chain chain = make_chain();
  chain.add(driven(Eigen::Vector3d::UnitZ(), 0.0));
  MeasuredMotion low_parallax = driven(-Eigen::Vector3d::UnitZ(), 1.0, FrameState::kLowParallax);
  low_parallax.parallax_px = 0.5 * OdometryOptions{}.min_parallax_px;
  chain.add(low_parallax);
  EXPECT_NEAR(chain.world_from_camera().translation.z(), 1.5, 1e-12);
  EXPECT_NEAR(chain.world_from_camera().angle_rad(), 1.0 * kDeg, 1e-12);
  MeasuredMotion stationary;
  stationary.state = FrameState::kStationary;
  chain.add(stationary);
  EXPECT_NEAR(chain.world_from_camera().translation.z(), 1.5, 1e-12);
}

TEST(MotionChain, AStepIsAsLongAsItsIntervalAndALostFrameTurnsOnForIt) {
  Chain chain = make_chain();
  chain.add(driven(Eigen::Vector3d::UnitZ(), 0.0));  // one step in 0.1 s
  chain.add(driven(Eigen::Vector3d::UnitZ(), 4.0), 0.25);
  EXPECT_NEAR(chain.world_from_camera().translation.z(), 3.5, 1e-12);
  EXPECT_EQ(chain.add({}, 0.05), FrameState::kLost);
  EXPECT_NEAR(chain.world_from_camera().angle_rad(), 4.8 * kDeg, 1e-12);
  EXPECT_NEAR(chain.world_from_camera().translation.z(), 3.5 + 0.5 * std::cos(4.0 * kDeg), 1e-9);
  chain.add_missing(0.1);
  chain.add(driven(Eigen::Vector3d::UnitZ(), 0.0), 0.1);  // from the lost frame on
  EXPECT_NEAR(chain.world_from_camera().translation.norm(), 6.0, 0.02);
}

struct Driven {
  DriveTracks drive;
  PairEstimator estimator{config_without_scale(OdometryMode::kTwoFrame), drive.camera};
  EstimatorRun run{estimator, drive};

  explicit Driven(DriveTracks tracks = DriveTracks(20, 0.1, 41)) : drive(std::move(tracks)) {}

  [[nodiscard]] Rigid3 last_motion() const {
    const std::vector<Rigid3>& poses = estimator.trajectory();
    return poses[poses.size() - 2].inverse() * poses.back();
  }
};

TEST(PairEstimator, EveryMeasuredStepIsOneUnitAndPosesStayAsTheyCame) {
  Driven d;
  d.run.add_all();
  EXPECT_EQ(d.run.state(0), FrameState::kFirst);
  EXPECT_EQ(d.run.state(1), FrameState::kInitializing);
  EXPECT_EQ(d.run.count(FrameState::kTracking), 18);
  EXPECT_LT(fitted_error_share(d.estimator.trajectory(), d.drive.world_from_camera), 0.01);
  EXPECT_LT(rotation_error_rad(d.estimator.trajectory(), d.drive.world_from_camera), 0.01);
  EXPECT_NEAR(d.last_motion().translation.norm(), 1.0, 1e-9);
  const std::vector<Rigid3>& poses = d.estimator.trajectory();
  ASSERT_EQ(poses.size(), d.drive.world_from_camera.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    EXPECT_EQ(poses[i].translation, d.run.results[i].world_from_camera.translation);
  }
  EXPECT_TRUE(d.estimator.landmarks_since(0).landmarks.empty());
}

TEST(PairEstimator, StationaryAndTurningHoldThePosition) {
  std::vector<Rigid3> path = DriveTracks::repeat(Rigid3({1.0, 0.0, 0.0, 0.0}, {0.0, 0.0, 1.0}), 8);
  const Rigid3 turn(so3_exp({0.0, 0.04, 0.0}), Eigen::Vector3d::Zero());
  path = DriveTracks::go_on(DriveTracks::go_on(path, Rigid3(), 4), turn, 4);
  Driven d(DriveTracks(path, points_along(path, 1500, 42), 0.02, 42));
  d.run.add_all();
  for (int i = 8; i < d.drive.num_frames(); ++i) {
    EXPECT_EQ(d.run.state(i), i < 12 ? FrameState::kStationary : FrameState::kRotating) << i;
    EXPECT_EQ((d.estimator.trajectory()[static_cast<std::size_t>(i)].translation -
               d.estimator.trajectory()[7].translation)
                  .norm(),
              0.0);
  }
  EXPECT_NEAR(d.estimator.trajectory().back().angle_rad(), 0.16, 1e-3);
}

}  // namespace
}  // namespace stemvo
